"""Momentum-based estimation of wheel momentum and inertial parameters."""
