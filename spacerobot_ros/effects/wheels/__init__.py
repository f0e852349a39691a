"""Effects of spinning wheels."""
