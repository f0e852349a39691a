"""Effects from outside: gravity, orbit, thrusters, pushes."""
