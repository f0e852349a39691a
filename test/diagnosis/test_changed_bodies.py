"""Ten numbers of a body give way to one that predicts parts of the data as well."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.comparison.compare import drop_needless_bodies


class Choice(SimpleNamespace):
    """A choice between a body at the last link, number 0, and a zero of an encoder, number 1."""

    def __init__(self, chosen, misfits):
        kinds = ('inertial_parameters', 'encoder_offset')
        candidates = [SimpleNamespace(kind=SimpleNamespace(id=kind)) for kind in kinds]
        super().__init__(chosen=chosen, rows=SimpleNamespace(candidates=candidates))
        folds = [SimpleNamespace(part=SimpleNamespace(rows=1000)) for _ in range(4)]
        self.parts = SimpleNamespace(folds=lambda: folds)
        self.gain = lambda i: 150.0
        self.held_out = lambda i: np.full(4, 20.0)
        self.is_stretched = lambda i, chosen: False
        self.held_out_misfits = lambda chosen: np.full(4, misfits[chosen[0]])
        self.instead_of = lambda i, barred: Choice([1], misfits)
        self.take = lambda other: setattr(self, 'chosen', other.chosen)


@pytest.mark.parametrize(
    ('by_offset', 'named'),
    [
        (1001.0, 1),  # 2 nats in four parts of 1000 rows: as good as the body, by one number
        (990.0, 1),
        (1005.0, 0),  # 10 nats, what odds of 20 are far below
    ],
)
def test_a_body_beats_what_is_simpler_or_goes(by_offset, named):
    choice = Choice([0], {0: 1000.0, 1: by_offset})
    drop_needless_bodies(choice)
    assert choice.chosen == [named]
