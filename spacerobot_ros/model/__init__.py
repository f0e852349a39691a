"""URDF and YAML to an immutable, validated robot; no ROS, no plotting."""
