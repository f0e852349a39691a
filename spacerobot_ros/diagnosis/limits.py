"""Every number that decides a name or a verdict, with where it comes from."""

from __future__ import annotations

import math

WRONG_ANSWERS = 1e-2
"""A stated error rate. One right answer in 100 is `partly_explained` for nothing, as it fits badly
or its values drift: less sharp than others, as only the verdict hangs on it (of 8 and then 3 wrong
answers, for an effect that was in no catalogue, 5 drift and 2 are below it). One machine in 100
that has no law has one by chance, of all its joints."""

EXACT = 0.05
"""Of what causes do, what their models may be wrong by: columns of effects at ten times their
limit are right within that. Five wrong explanations at that strength drift by 8 to 17 %; a gyro
that is late by 13 ms, a thousand times what the noise shows, drifts by less than that. A law of
whose square causes leave less is of the shape of one of them."""

LITTLE, IMITATED = 1.0 / 3.0, 400.0
"""Extra sum of squares of one cause beside all others, by the mean share of what all do and in
itself, below which it may be what a wrong name leaves. Of pairs of columns that hide a third
effect, the lesser adds less than a third of half in 92 % (`test/diagnosis/test_stand_ins.py`); of
three right ones, all weak, half was seen. Of effects ten times their limit, some 3000 in squares,
wrong explanations have 28 to 343, the campaign's right pairs and triples 272, 1039 and more. An
effect m times its limit adds 30 m^2: one below 3.6 times, beside one that is 2.3 to 20 times as
far above its own, is the price."""

CANCELLED = 2.0
"""Squares of what causes change each, by the square of what they change together, from which they
explain nothing: two of a size undo half of each, at a correlation of -1/2. Of 52 pairs and triples
as the campaign hides them 3 have more (2.1, 2.7, 8.5), the others at most 1.4; what stood for an
effect that was in no catalogue had 1.4 to 120 in 5 of 11 records."""

SUSPICIOUS = 0.1
"""Probability of the fit below which effects with states of their own are looked at, too. They
leave slow errors or spectral lines where they are visible at all, so this costs no name: a tenth
of all clean records is searched for nothing."""

UNLIKE_STEPS = 100.0
"""Nats of causes that leave nothing which no step of the momentum can be: it shows for some four
seconds, and what lasts leaves a few of its nats there at least, where `MISFIT` is 9."""

CURVED = 0.1
"""Share of what a cause adds by which columns may be wrong about it: twice what those of effects
at ten times their limit are. Causes of a lesser share than that are fitted later, and a set that
does worse by less than that is fitted."""

FITS = 0.05
"""Probability of a fit from which a timing of the efforts asks for no cause beside it: for one
right model in twenty every timing is compared with a cause beside it, which costs time alone."""

LIKE_NOISE = 3.0
"""Times what sensor noise leaves of a torque in the band that may be left for a search to the
noise of the sensors to be tried: what a mass matrix at other angles, and a noise level that is
itself estimated, may be off by. On measured arms 10 to 100 times are left."""

FEWEST_ROWS, ENOUGH_ROWS = 0.75, 3.0
"""Torques of an arm by numbers that may be wrong: fewer are refused, so many are asked for. Of
simulated arms whose file has no friction 6 of 12 had a name beside it with 0.35 and 0.55, 4 of 36
with 0.9 to 4.5 (`RealArm`, 1.5 to 12 s of six joints); lone joints of a fast pendulum have 0.9."""

RELEVANT = 0.01
"""Of the rms torque of the joint where a cause of an arm shows most: less is fitted, not named. It
is a third of what the best torque sensors are right within (docs/real_machines.md). Of what the
model misses at a joint without a motor, of whose torque nothing is uncertain."""

FULL_SCALE = 3e-3
"""Of a motor's full scale: what a measured torque is off by whatever it is. Arms of stated limits
leave 0.1 to 0.45 % of them at their wrists (KUKA LWR4+ 0.05 to 0.1 of 38 N m, Panda 0.05 of 12,
UR10e 0.25 of 56), as torque sensors and current transducers are specified. It decides whether more
is left than usual, no name."""

CLEAR = 2.0
"""Standard deviations that one coefficient of a law which is said, not applied, must be from
nothing: odds of 20."""

CHANCE = math.erfc(CLEAR / math.sqrt(2.0))
"""Probability, of a cause's numbers together and with their deviations as printed, from which it
is no chance: two deviations of one number. With evidence beside it, odds of 20 are enough."""

DIFFERENT = 2.0
"""Times what is left of a joint's torque in the worst block of the recordings before, from which
what is left of all recordings afterwards is another machine's. Of 220 joints of pairs of which
nothing was changed at that joint (KUKA, UR10e, XL330, `RealArm`) the most is 1.5."""

LINE = 0.5
"""Share of a cause's evidence at the level beside it from which what is left is of the family of
levels there. A swing of one frequency is a line itself, whose bin would hide any cause in it;
beside its causes nothing is left there (2 to 50 times the evidence). Of what went with lines
of noise at most 0.2 was left."""

FALSE_PER_HOUR = 1.0
"""Events named in an hour in which nothing comes from outside: the stated rate of false names."""

LISTED = 5.0
"""Standard deviations from which something may be an event: white noise on seven joints exceeds it
once in four hours."""

SUSPECTED = 3.5
"""Standard deviations from which something is no part of the level of the rest. Four pushes in
five seconds of motion reach 3 to 8 beside a level that has them, 7 to 15 beside one without; of
white noise on seven joints half a minute has one such time, and its level hardly changes."""

EVENT = 10.0
"""Standard deviations from which an event is named at least. On quiet records of measured arms
what exceeds `LISTED` does so by `EXCESS` on average, a hundred times an hour: an exponential tail
gives one false name an hour at 8.7, and a shape that is no bell has less."""

EXCESS, EXCESSES = 0.8, 6.0
"""Mean of what exceeds `LISTED` on quiet records, and of how many excesses it is the mean: beside
those of a machine's own records. One of seven exceeds it by twice the mean, or is an event."""

QUIET = 0.3
"""A quantile of all times that events on 40 % of a record leave alone: the level of the rest."""

SCATTERED = 1.5
"""Times that steps may scatter more than in white noise for what lasts to be fitted well enough to
look for them first: else causes are, and steps beside them."""

EXPLAINED = 0.8
"""Of a joint's torques squared that the model must explain for the rest to be judged."""

REST_SHARE = 1.2
"""Times the Coulomb torque that the torque of a joint at rest may be off its usual value: dry
friction holds anything between plus and minus that torque, and starts above it by some tenths."""

FRICTION_SHARE = 0.1
"""Of a joint's largest torque in the URDF that its dry friction is thought to be at most, where
nobody says: 5 to 7 % on a UR10e."""
