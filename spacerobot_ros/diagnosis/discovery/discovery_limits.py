"""Every number that decides whether a leftover depends on something, with where it comes from."""

from __future__ import annotations

from ...inference.decisive import CONFOUNDED

CHANCE = 0.01
"""Probability below which a law is no chance, of one search or of those of all joints together:
one machine of 100 may have one that is (asked)."""

MARGIN = 3.0
"""Nats beyond all prices that a law must gain: odds of 20, where `strong` begins (Kass and Raftery
1995). The best law of 400 channels without one gains 3.4 twice, with p of 3e-3 and 4e-3, else 2.3
at most (docs/discovery.md)."""

LEFT = 0.05
"""Share of a column's square that free causes and chosen laws must leave of it: less is theirs."""

DEAD_HEAT = CONFOUNDED
"""Gap in nats within which two laws are not told apart, as between causes (`CONFOUNDED`)."""

UNSETTLED = 0.05
"""Odds of laws of other variables together, beside the best, from which nobody knows which are
right: 1 to 20, as `MARGIN`. A product of two rates stood for sines of two angles with 0.07."""

MOST_LAWS = 4
"""Laws of one channel: more were never right."""

HELD_OUT = 0.025
"""Share of left-out parts of the data that a law must explain: what 4 nats of 310 terms are."""

BEYOND_PLACEBO = 0.01
"""Share by which that must exceed the best placebo's."""

AGREEING = 0.6
"""Share of left-out parts that must be predicted better with the law than without."""

FED_IN = 0.25
"""Largest share of the power of friction that may push, with the named friction beside it."""

NEEDS_OTHER = 0.8
"""What a law with another joint's variable leaves of left-out parts, by what the best law of the
joint alone leaves: more, and the other joint is not needed, unless `OWN_SHARE` says so, or it
predicts left-out parts better by more than `DEAD_HEAT`: of 95 such laws on 240 machines four were
refused that did so by 7 to 30 nats, all of them right."""

OWN_SHARE = 0.5
"""Of what a law with another joint's variable explains of left-out parts, the most that the best
law of the joint alone may: where noise is most of what both leave, that is what tells them
apart."""

ONE_SPEED = 0.2
"""Of its middle speed: a joint whose speeds spread less moves at one speed, where friction that
grows with the rate is friction that does not."""

LARGEST_LAW = 1.49
"""Of its largest torque in the data, what a learned law may ever give: 1.5 is promised, and the
motion of the data is known to its noise (1.5002 times was seen at 1.5, `reproduce discovery`)."""
