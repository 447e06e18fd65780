"""Simulated worlds that know no task: fixtures, obstacles, backends, errors of sensors and motors, native stepping."""
