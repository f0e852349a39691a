"""Notice when /clock goes back, as after a reset of the simulation or when a bag starts again."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import JumpHandle, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node

STAMP_JUMP_NS = 1_000_000_000
"""Stamps that go back further than this are another run, not samples out of order [ns]."""


def on_backward_jump(node: Node, react: Callable[[], None]) -> JumpHandle:
    """Call `react` whenever the node's clock has gone back, as long as the handle is kept."""
    threshold = JumpThreshold(
        min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False
    )
    return node.get_clock().create_jump_callback(threshold, post_callback=lambda _: react())
