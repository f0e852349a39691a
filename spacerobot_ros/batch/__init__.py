"""Many tasks at once: who runs them, recordings of a fleet, Monte Carlo of the closed loop."""
