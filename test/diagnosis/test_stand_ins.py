"""What an effect out of the catalogue is taken for is not said to explain the data."""

from __future__ import annotations

from validation.hidden.diagnosis_campaign import HiddenCase, run


def test_an_effect_that_is_in_no_catalogue_is_not_explained():
    """Drag of the wheels, of which their momentum and a drag of the target's leave nothing."""
    case = HiddenCase(
        kind='left_out',
        robot='servicer',
        excitation='default',
        seed=13100,
        effects=('servicer_wheel_drag',),
        multiple=10.0,
    )
    answer = run(case.key)
    assert answer['verdict'] == 'partly_explained'
