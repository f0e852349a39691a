"""Immutable records of measured or simulated runs, in and out of bags."""
