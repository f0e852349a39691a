"""Thin ROS 2 nodes."""
