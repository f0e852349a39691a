"""Effects at joints: friction, gears, motors."""
