"""What changed between recordings of one machine."""
