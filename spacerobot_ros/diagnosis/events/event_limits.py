"""What decides whether something is an event, with where it comes from (docs/events.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence

FALSE_PER_HOUR = 1.0
"""False events named in an hour that limits are made for."""

LISTED = 5.0
"""z from which something is listed: white noise on seven joints exceeds it once in four hours."""

QUIET = 0.3
"""A quantile of z of all times that events on 40 % of a record leave alone."""

SUSPECTED = 3.5
"""z from which something is left out until the level of the rest is known. Four pushes in five
seconds of motion reach 3 to 8 beside a level that has them, 7 to 15 beside one without; of white
noise on seven joints half a minute has one such time, and its level hardly changes without it."""

NAMED = 10.0
"""z from which something may be named. On quiet records of measured arms what exceeds `LISTED`
does so by `EXCESS` on average, a hundred times an hour: an exponential tail gives one false name
an hour at 8.7. A pulse of `SNR` reaches it with room for a shape that is no bell."""

EXCESS, _RECORDS, _TAIL = 0.8, 6.0, 6.5
"""Mean of z beyond `LISTED` on quiet records, of how many excesses that is the mean, and the z
below which what is listed is thought to be such an excess: five of six are. Events reach any z,
and where they are many would raise a limit that counts them."""

ROOM = 2.0
"""Of z, by which a promised size exceeds the limit: for the noise of one in twenty, for times at
which less is seen than usual, and for a shape that is no bell."""

EXPLAINED = 0.8
"""Of a joint's torques squared that the model must explain for the rest to be judged."""

REST_SHARE = 1.2
"""Times the Coulomb torque that the torque of a joint at rest may be off its usual value: dry
friction holds anything between plus and minus that torque, and starts above it by some tenths."""

FRICTION_SHARE = 0.1
"""Of a joint's largest torque in the URDF that its dry friction is thought to be at most, where
nobody says: 5 to 7 % on a UR10e."""

STEADY = 1.5
"""Times that z of steps may scatter more than in white noise for what lasts to be fitted well
enough to look for steps first: else causes are, and steps beside them."""


def named_from(sizes: Sequence[float], hours: float) -> float:
    """Z from which `FALSE_PER_HOUR` false events are expected, on this machine.

    What is listed below `_TAIL` is taken to be that part of an exponential tail.

    Args:
        sizes: z of all that is listed.
        hours: Length of the recordings.
    """
    tail = [z - LISTED for z in sizes if z < _TAIL]
    excess = (_RECORDS * EXCESS + sum(tail)) / (_RECORDS + len(tail))
    per_hour = (len(tail) + 0.5) / hours / -math.expm1(-(_TAIL - LISTED) / excess)
    return max(NAMED, LISTED + excess * math.log(max(per_hour / FALSE_PER_HOUR, 1.0)))


FALSE_ALARMS = 1e-3
"""Expected false names a record, over all candidates and the values that were searched
(Bonferroni). The campaign saw 1 in 284 clean records, 95 % bound 2 %."""
