"""What gyro and star tracker of a free base said of late, and whether that is still fresh."""

from __future__ import annotations

import numpy as np

from ..model.control_settings import ControllerSettings
from ..types import Array
from .command import AttitudeHistory, Feedback, RateHistory


class BaseSensors:
    """Recent rates and attitudes of the base.

    Args:
        settings: Their time-outs.

    Attributes:
        rates: Of the gyro.
        attitudes: Of the star tracker.
    """

    def __init__(self, settings: ControllerSettings) -> None:
        timeouts = (settings.state_timeout, 0.25 * settings.attitude_timeout)
        span = max(0.5, 4.0 * max(timeouts))
        self.rates, self.attitudes = RateHistory(span), AttitudeHistory(span)
        self._rate_ns = round(settings.state_timeout * 1e9)
        self._attitude_ns = round(settings.attitude_timeout * 1e9)

    def missing(self, stamp_ns: int, needs_attitude: bool) -> str:
        """Which sensor is missing or too old at a stamp; empty where none is."""
        newest = self.rates.newest_ns
        if newest is None:
            return 'no gyro sample yet'
        if stamp_ns - newest > self._rate_ns:
            return 'gyro is stale'
        if not needs_attitude:
            return ''
        newest = self.attitudes.newest_ns
        if newest is None:
            return 'no attitude yet'
        return 'attitude is stale' if stamp_ns - newest > self._attitude_ns else ''

    def feedback(
        self, stamp_ns: int, q: Array, qd: Array, base_ns: int, needs_attitude: bool
    ) -> Feedback:
        """Joints (n,) with the base at their stamp; a gyro that is too old is not extrapolated.

        Args:
            stamp_ns: Of the joints.
            q: [rad].
            qd: [rad/s].
            base_ns: Time over which the rate's slope is taken, at least.
            needs_attitude: Whether the law asks for the attitude.
        """
        newest = self.rates.newest_ns
        if newest is None:
            return Feedback(q, qd, np.zeros(3), np.zeros(3))
        seen_ns = newest if stamp_ns - newest > self._rate_ns else stamp_ns
        omega, slope = self.rates.at(seen_ns, base_ns)
        attitude = self.attitudes.at(stamp_ns, self.rates) if needs_attitude else None
        return Feedback(q, qd, omega, slope, attitude)
