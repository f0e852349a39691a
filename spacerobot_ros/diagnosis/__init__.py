"""From measured data to a named cause, an extended model and a measured gain."""
