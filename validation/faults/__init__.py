"""Trials of faults: odd messages, damaged files, streams that go wrong, processes that end."""
