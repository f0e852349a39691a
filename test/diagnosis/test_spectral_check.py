"""What goes with a narrow line of noise is no cause; delays are as whitened rows say."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.inference.spectral_terms import SpectralTerms
from validation.hidden.discovery_campaign import HeldArm
from validation.hidden.real_arm import RealArm, arm_file


@pytest.mark.parametrize(
    ('seed', 'law', 'ratio'), [(70026, '', 0.0), (1003, 'coupled viscous', 1.0)]
)
def test_what_goes_with_a_line_of_noise_is_no_cause(seed, law, ratio):
    """A ripple beside a spring was, and a body of 400 nats, 50 at the level beside it."""
    machine = HeldArm(seed, law, ratio, 'line')
    answer = diagnose(machine.record(), machine.file.robot, machine.file.effects)
    assert answer.causes == ()


def test_a_delay_of_a_third_of_a_sample_is_named():
    """Rows as they are say 0.8 ms."""
    late = CATALOGUE['effort_delay'](name='late', where=None, values={'delay': 0.0042})
    file = arm_file()
    answer = diagnose(RealArm(22, (late,)).record(0), file.robot, file.effects)
    assert [c.applied.id for c in answer.causes] == ['effort_delay']
    delay = answer.causes[0].parameters['delay']
    assert abs(delay.value - 0.0042) < 3.0 * delay.std < 0.003


def test_channels_have_levels_of_their_own(rng):
    """The likelihood of two that share nothing is the sum of theirs; a third has no terms."""
    data, columns = rng.standard_normal((2, 80)), rng.standard_normal((2, 80, 3))
    data[1] *= 50.0
    alone = [SpectralTerms(d, c) for d, c in zip(data, columns, strict=True)]
    both = np.zeros((160, 6))
    both[:80, :3], both[80:, 3:] = columns
    together = SpectralTerms(data.ravel(), both, (80, 160))
    found, *each = (t.level(np.zeros((len(t.data), 0))) for t in (together, *alone))
    assert found.likelihood == pytest.approx(sum(e.likelihood for e in each))
    np.testing.assert_allclose(found.scale, np.concatenate([e.scale for e in each]))
