"""A real robot: control process, policy process, watchdog and flight recorder, each alone in its process."""
