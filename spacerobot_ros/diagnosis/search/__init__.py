"""Search for causes of what a predicting filter misses: rounds, second thoughts, conclusion."""
