"""The experiments of the two papers, beside their printed figures."""
