"""Lines of raw signals against angles that turn."""
