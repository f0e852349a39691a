"""Faults of the data themselves: with one of them nothing physical is concluded."""
