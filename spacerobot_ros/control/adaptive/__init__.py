"""Adaptive control of a free-flying robot: base attitude and joints, translation free."""
