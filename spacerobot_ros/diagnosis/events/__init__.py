"""Events: what came from outside once, found beside all that is constant."""
