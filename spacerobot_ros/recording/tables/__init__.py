"""CSV, JSON and npz files by a mapping of their columns."""
