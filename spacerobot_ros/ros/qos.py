"""Quality of service of every topic, once (docs/nodes/ states it for each)."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def _reliable(depth: int, durability: DurabilityPolicy = DurabilityPolicy.VOLATILE) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


STATE = _reliable(10)
"""States, sensors and commands."""

SAMPLES = _reliable(1000)
"""The same for who must miss no sample while it computes."""

LATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
"""The last one reaches who comes late: model, estimate."""


def best_effort(qos: QoSProfile) -> QoSProfile:
    """The same for publishers that offer best effort alone, as drivers of sensors do."""
    return QoSProfile(depth=qos.depth, reliability=ReliabilityPolicy.BEST_EFFORT)
