"""After the rows: evidence, constrained solutions, placebo, test of fit."""
