"""What a fault of the data is, and every number that decides on one.

A slip of a data sheet changes a signal by much: a sign by 200 %, the smallest factor of units by
9.5. Physical causes of the catalogue stay within some ten per cent of scale or 0.1 rad of angle.
The limits lie between, in shares of the signals' energy, squares summed: what differs by a factor
1 + e leaves a share of about e^2. `test/recording/faults` tries both sides: every slip on three
robots, and the catalogue's sensor effects at sizes that are large for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...types import Array

# Kinematics: a signal against the integral of its rate.
DISAGREE = 0.3  # share that can't be a physical cause: 55 % of scale, 0.55 rad of angle
AGREE = 0.03  # share that a named slip may leave: 17 % of scale, so slip and cause may be together
WINDOW = 0.2  # s, of motion that is compared: noise of an encoder is small beside it
FEWEST_WINDOWS = 3  # fewer agree by chance
MOST_WINDOWS = 2000  # no more are looked at: they cost time and add nothing
EXTREME = 5.0  # standard deviations: noise is beyond them in 1 of 1000 times `MOST_WINDOWS`
MOVED = 3e-3  # rad rms in a window; below it noise passes for disagreement where no slip is named
COMMON = 0.05  # by which factors of joints may differ that are the clock's: scales of sensors
FAR_BEYOND, BEYOND = 5.0, 1.05  # of a limit: no encoder's zero is off by so much; what is within
AT_LIMIT = 1e-3  # rad or m, from a joint's limit: URDFs have three digits, encoders 12 bits
GIVES_WAY = 0.05  # rad or m, beyond it: a stop that brakes 2 rad/s in 50 ms, a gear that bends;
# limits that a joint passes by more are none of its stops, or in another unit
AROUND_STOP = 0.1  # s, around a jump of a rate: two knots of the splines that a motion is taken as
OWN_SCALE = 0.15  # logarithm of a factor up to which it may be a cause: rates that are filtered

# Dynamics: measured efforts against the model's torques.
UNLIKE = 0.02  # share of a joint's torque that the model doesn't explain: less is no slip (14 %)
ALIKE = 0.03  # a slip must leave less than this,
GAIN = 20.0  # and this much less than none: friction and wheels leave more
BODY_OFF = (
    0.25  # of a body's mass and inertia, as a tool that is mounted or a file of another make
)
SPOILED = 1.2  # a slip may leave this much more to a joint that it does not mend: noise
TURNED = 0.35  # rad from the file's gravity; less is a base that does not stand level
NEARER = 0.5  # of what is unlike beside friction and bias: a base that is turned leaves a tenth,
# friction of one way that is taken for it several times as much
SPAN = 0.25  # s, over which positions are smoothed to be derived twice
SLOW, BESIDE = 3e-3, 0.1  # rad/s, and of the fastest joint's rms rate: the smaller is standing
SELDOM = 0.2  # of the times: a joint that moves at less of them is held by friction
ROWS = 100  # times at which torques are compared, some times a robot's unknowns

# Clocks.
PERIODS = (2e-5, 2.0)  # s; samples closer or farther are not stamped in seconds
JUMP_PERIODS = 10.0  # of the usual period: a longer step is a pause or a jump
NEAR, FEWEST_NEAR = 0.3, 8  # s and samples on each side of a pause that are looked at
SEEN = 3.0  # of the misfit without a pause: more with it is a jump
FASTER = 2.0  # than ever: nothing that is logged says that a joint moved so over a pause
ORDINARY = 0.98  # of the steps from sample to sample are usual; a larger one may be a leap,
LEAP = 0.05  # rad or m, at least: an encoder's tooth, a tracker's correction are less
OVERLAP = 0.5  # share of the shorter record that two sensors must have in common

# Amount.
FEWEST_SAMPLES = 50  # of the joints: a spline through fewer has no noise left to see
SHORTEST = 2.0  # s; the filter needs a part of it to find the state
DEAD_TURN = 0.1  # of the largest turn about any axis: about a dead axis the base turns more


@dataclass(frozen=True, slots=True)
class DataFault:
    """A fault of the data.

    Args:
        kind: `absent`, `short`, `constant`, `scale`, `sign`, `exchanged`, `order`, `frame`,
            `gravity`, `clock`, `joined` or `foreign`.
        place: Channel, such as `joint_rate/joint_2`.
        message: What is wrong, in a sentence without the place.
    """

    kind: str
    place: str
    message: str

    def __str__(self) -> str:
        """One line."""
        return f'{self.place}: {self.message}'


def is_short(seconds: Array) -> bool:
    """Whether samples of the joints at (N,) times are too few, or end too early, to be judged."""
    return len(seconds) < FEWEST_SAMPLES or float(np.ptp(seconds)) < SHORTEST


def in_lines(faults: tuple[DataFault, ...]) -> tuple[str, ...]:
    """One line a message, with all the places that have it."""
    places: dict[str, list[str]] = {}
    for fault in faults:
        places.setdefault(fault.message, []).append(fault.place)
    return tuple(f'{", ".join(where)}: {message}' for message, where in places.items())
