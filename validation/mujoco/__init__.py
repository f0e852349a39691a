"""Truth of an engine that shares no code with the package: MuJoCo."""
