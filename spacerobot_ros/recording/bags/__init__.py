"""Rosbag2 recordings, in and out."""
