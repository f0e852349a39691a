"""What a diagnosis says, made from its fit: results, JSON, extended model."""
