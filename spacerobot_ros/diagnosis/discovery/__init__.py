"""What a leftover depends on when no effect of the catalogue explains it."""
