"""Campaigns whose truth shares no code with the package; not installed."""
