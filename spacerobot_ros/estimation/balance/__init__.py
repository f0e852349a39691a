"""Rows by balance of torques along a measured motion, whitened by the level of what is left."""
