"""Effects of bodies: inertia, panels, fuel, a soft grasp."""
