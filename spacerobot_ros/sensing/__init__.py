"""Simulated sensors: noise, rates and stamps."""
