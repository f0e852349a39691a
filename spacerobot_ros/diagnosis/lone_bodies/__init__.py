"""Robots without joints: spin, nutation, thrusters."""
