"""Onboard estimation and control of a free-floating space robot with a captured body's wheels."""

__version__ = '0.1.0'
