"""The spacerobot command line."""
