"""What is hidden in data and has to be found: effects, laws, events, faults in flight."""
