"""Every number that decides whether an estimate is used, each with where it comes from."""

from __future__ import annotations

BETTER_THAN_PRIOR = 3.0
"""Standard deviation of the prior over that of the data, from which on a direction counts as
excited: the prior then holds a tenth of the information, 1 / (1 + 3^2), and bends the estimate by
at most a tenth of its own error."""

BETTER_THAN_PLACEBO = 100.0
"""Information of the data over what the reference's own error makes up, likewise: noise in a
regressor shrinks an estimate by 1 / (1 + ratio), here by a hundredth."""

LARGEST_CHI2 = 2.0
"""Chi-square per degree of freedom beyond which the model does not explain the data. Standard
deviations below it understate errors by at most a factor of 1.4; a right model with the stated
noise scatters by 0.01 in 20 s of 100 Hz (test_maximum_likelihood), so it is never refused."""

MISFIT_P = 1e-4
"""Probability of the misfit of physical bodies below which they contradict the robot's structure:
the rate of false contradictions, one in ten thousand estimates."""

EXCHANGED_MISFIT = 0.4
"""Misfit of momentum with two joint columns exchanged over that as given, below which they are
taken to be swapped. The right order leaves 0.003 to 0.015 of the misfit (servicer, four sets of
joint axes, 20 s), and an exchange of right columns multiplies it by 70 or more: ten times the
noise stays below, a right record far above."""

CONVERGED = 0.01
"""Shift of the constants in a pass, in standard deviations, at which the iteration has settled:
what is left is that much below what noise does."""

MOVED = 3.0
"""Shift of the constants since the last run through the buffer, in its standard deviations, that
asks for another: three are beyond what noise explains, so the linearization was about others."""

SMALLEST_INERTIA = 0.05
"""Of the prior's smallest inertia: below it D^-1 is twenty times as large, and a linearization
about it holds nowhere."""

SHORTEST = 2.0
"""Seconds of a record, below which splines of half a second's knots are all ends."""

FIRST = 4.0
"""Seconds of data before the first solution online: half of it is the lag and the splines' end."""
