"""The extended model for other simulators, and what is lost on the way."""
