"""Nodes under faults: odd messages, kills, floods, streams that go wrong."""
