"""A recording as a moving scene: bodies, tracks of time, and what the model would have done."""
