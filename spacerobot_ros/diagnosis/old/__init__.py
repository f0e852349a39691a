"""The choice before the engine: what changes, laws, bodies without joints and pieces still use."""
