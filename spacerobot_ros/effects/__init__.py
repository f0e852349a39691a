"""Physical effects: each written once, simulated and fitted alike."""
