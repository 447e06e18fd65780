"""What all tasks are built on."""
