"""Conversions, parameters and quality of service shared by the nodes."""
