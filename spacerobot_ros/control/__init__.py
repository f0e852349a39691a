"""References and model-based control laws."""
