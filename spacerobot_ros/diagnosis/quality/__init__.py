"""What a recording is worth, before anything is concluded from it."""
