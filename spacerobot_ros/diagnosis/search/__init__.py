"""Causes of what a predicting filter misses: columns, fits, conclusion."""
