r"""Whether a quantity drifts: a straight line through its values, and how surely it is not flat.

    value_k = a + b t_k + e_k,   var(e_k) = s^2 std_k^2,   s^2 = max(1, chi^2 / (N - 2)),

fitted by least squares; b / std(b) is compared with Student's t of N - 2 degrees of freedom.
Values scatter more than their standard deviations say where the machine itself varies: s covers
that (Birge 1932). Without standard deviations all are alike, and s is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from .fleet_table import Course

FEWEST = 4
"""Recordings of a trend: with three a line has one degree of freedom, and its t no tails' end."""
SIGNIFICANT = 0.01
"""Probability that any of all trends of a report is called a drift where none is (Holm 1979)."""


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """A line through a course.

    Args:
        course: The values.
        level: At the mean time. slope: By a unit of time. std: Of the slope.
        p_value: Probability of such a slope without a drift, this quantity alone.
        is_drift: Whether it is significant among all that were asked.
    """

    course: Course
    level: float
    slope: float
    std: float
    p_value: float
    is_drift: bool = False


def trends(courses: Sequence[Course]) -> list[Trend]:
    """Lines through all courses that are long enough, surest first."""
    found = [_line(h) for h in courses if len(h.time) >= FEWEST and np.ptp(h.time) > 0.0]
    found.sort(key=lambda line: (line.p_value, line.course.machine, line.course.quantity))
    out, is_drift = [], True
    for i, line in enumerate(found):
        is_drift = is_drift and line.p_value * (len(found) - i) < SIGNIFICANT
        out.append(replace(line, is_drift=is_drift))
    return out


def _line(course: Course) -> Trend:
    is_known = bool(np.all(course.std > 0.0))
    weight = course.std**-2.0 if is_known else np.ones(len(course.time))
    mean = weight @ course.time / weight.sum()
    t = course.time - mean
    level = weight @ course.value / weight.sum()
    information = weight @ t**2
    slope = weight @ (t * course.value) / information
    left = course.value - level - slope * t
    freedom = len(t) - 2
    scatter = weight @ left**2 / freedom
    scatter = max(1.0, scatter) if is_known else scatter
    std = float(np.sqrt(scatter / information))
    # of values that lie on their line to rounding, such as none at all, nothing is sure
    rounding = 1e-12 * float(np.max(np.abs(course.value))) / float(np.ptp(t))
    ratio = abs(slope) / max(std, rounding) if slope else 0.0
    p_value = float(2.0 * student.sf(ratio, freedom))
    return Trend(course, float(level), float(slope), std, p_value)
