"""What is unknown, as forces and columns along a motion: effects, parameters, nuisances."""
