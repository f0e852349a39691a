"""Linear algebra of Gaussian hypotheses: it knows no robot, no recording and no effect."""
