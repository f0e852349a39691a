"""Every number that decides whether an estimate is used, each with where it comes from."""

from __future__ import annotations

LARGEST_CHI2 = 2.0
"""Chi-square per degree of freedom beyond which the model does not explain the data. Standard
deviations below it understate errors by at most a factor of 1.4; a right model with the stated
noise scatters by 0.01 in 20 s of 100 Hz (test_maximum_likelihood), so it is never refused."""

SUSPICIOUS, SUSPICIOUS_SCATTER = 1.25, 5.0
"""Chi-square of a new stretch over that of all before, and by how many of its standard deviations
it is higher, from both of which on the stretch is left out once: by chance once in 3 million."""

FROM_DATA, FROM_FILE = 0.9, 0.1
"""Share by which data shrank a number's variance, above and below which it is from the data or
from the file alone: beyond the first the prior bends it by a tenth of its deviation at most."""

CONTRADICTED = 4.0
"""Stated deviations of a body's number beyond which the file is said to be contradicted: of 300
numbers of a right file one is, once in fifty recordings."""

MOST_LINES = 5
"""Lines about what only the file tells, or is contradicted."""

NO_MOMENTUM = 3.0
"""Square of the wheel momentum in its deviations, an axis, below which it is called none: three
axes at rest have more once in 34 times, momentum of five deviations less once in 40."""

EXCHANGED_MISFIT = 0.4
"""Misfit of momentum with two joint columns exchanged over that as given, below which they are
taken to be swapped. The right order leaves 0.003 to 0.015 of the misfit (servicer, four sets of
joint axes, 20 s), and an exchange of right columns multiplies it by 70 or more: ten times the
noise stays below, a right record far above."""

CONVERGED = 0.02
"""Largest shift that another pass is expected to make, in standard deviations, at which the
iteration has settled: what is left is that much below what noise does."""

CONTRACTION = 3.0
"""By how much the share of a shift that a pass leaves may exceed the one before: in ten flights of
the servicer shares were 0.002 to 0.04 at first and fell later, in one they rose threefold."""

MOST_PASSES = 20
"""Passes of the iteration; flights of two to seven joints settle in two also where bodies are off
by a third, arms of nine and fourteen then in five to nine."""

MOVED = 1.0
"""Shift of the constants since the last run through the buffer, in its standard deviations, that
asks for another: what it was linearized about is then further off than noise explains."""

WEAKLY_KNOWN = 3.0
"""Of `ls`: standard deviation by which numbers may be wrong, the largest of them, over that of the
data, from which on a direction counts as excited."""

SHORTEST = 2.0
"""Seconds of a record, below which splines of half a second's knots are all ends."""

FIRST = 4.0
"""Seconds of data before the first solution online: half of it is the lag and the splines' end."""
