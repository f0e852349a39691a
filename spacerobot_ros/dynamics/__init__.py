"""Momentum, equations of motion, wheels and integration."""
