"""Every number of the engine that decides a name, a set or a deviation, with where it comes from.

Bounds, sizes, tolerances and prior odds of single effects are the hypotheses' own.
"""

from __future__ import annotations

FAMILYWISE = 3.0
"""Nats of log odds against any hypothesis beyond ln of their number: exp(-3) = 5 % is the prior
probability that a record has any cause at all."""

NAMED = 3.0
"""Nats that a name takes, odds of 20: by which a cause must raise the log predictive density of
held-out parts, or of all but the best where it is not steady; log odds of a change, less the
scatter over blocks by which they are known."""

STEADY = 1.7
"""Sum of these gains by its standard error over the parts, from which their scatter is no
objection: with five degrees of freedom, those of six parts, chance passes it in 7.5 %."""

PARTS = 6
"""Of one recording, held out one after the other: the fewest whose t-distribution has a finite
fourth moment, so that `STEADY` means the same on any recording."""

TELLING = 0.01
"""Share of what all recordings tell of a cause from which one says something: a prediction from a
hundredth of the information has ten times the standard deviation, and tests nothing."""

CONFOUNDED = 6.0
"""Nats within which two causes are not told apart: odds of 400 to 1. `Very strong` begins at 150
to 1 (Kass and Raftery, J. Am. Stat. Assoc. 90 (1995)); a Gaussian prior's tail adds a nat."""

IMPLAUSIBLE = 5.0
"""Slabs beyond which a value is a doubt of its own: one normal value in 1.7 million."""

MISFIT = 1e-4
"""Probability below which a model does not fit: one right model in 10,000."""

CLUSTERS = 30
"""Fewest blocks for a cluster-robust covariance: a standard deviation from so many is itself known
to 1 / sqrt(60) = 13 %."""

MOST_RESOLVED = 1e3
"""Times the variance that is worth one datum that a slab may have: values of up to 30 sqrt(N)
standard deviations are plausible. Rounding of the marginal sums, 1e-16, grows by as much."""
