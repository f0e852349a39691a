"""Design of motions that tell as much as possible about wheel momentum and inertia."""
