"""Closed-loop runs without ROS."""
