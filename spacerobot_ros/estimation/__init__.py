"""The one estimation engine: rows, columns, evidence, constrained refit, test of fit."""
