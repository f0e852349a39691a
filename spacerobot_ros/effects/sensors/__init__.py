"""Effects on what sensors say, and when."""
