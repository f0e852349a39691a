"""Rows by prediction: a Kalman filter, driven by momentum or by torques."""
