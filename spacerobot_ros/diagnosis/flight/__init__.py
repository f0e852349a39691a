"""The recursive reading of the engine in flight: block by block, alarms with a stated rate."""
