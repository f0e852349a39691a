"""Many recordings of machines: found, diagnosed one by one, one table, what drifts."""
