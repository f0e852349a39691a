"""The demonstration: excite and identify, then track without and with what was found."""
