"""The closed loop over ranges."""
