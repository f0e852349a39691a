"""Causes of what a balance of torques misses: choice, checks on other motion, values, verdict."""
