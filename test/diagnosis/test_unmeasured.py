"""A law of the robot file whose input a recording lacks is said."""

from __future__ import annotations

from types import SimpleNamespace

from support.laws import law_entry

from spacerobot_ros.diagnosis.discovery.other_recording import unmeasured_inputs, unshared_extras
from spacerobot_ros.effects.catalogue import bind_effects
from validation.hidden.real_arm import arm_file


def law_of(*inputs):
    form = 'x, x*y' if len(inputs) == 2 else 'x'
    extra = {'temp': {'unit': 'degC', 'typical': 0.0}} if len(inputs) == 2 else None
    entry = law_entry(form, inputs, [-1.0] * len(inputs), 'joint_2', extra=extra)
    return bind_effects({'warm': entry}, arm_file().robot)


def test_a_law_of_what_no_recording_or_not_every_one_has_is_named_with_its_input():
    effects = law_of('rate/joint_2', 'extra/temp')
    has, lacks = SimpleNamespace(inputs={'extra/temp': None}), SimpleNamespace(inputs={})
    for records in ([lacks], [has, lacks]):
        (note,) = unmeasured_inputs(effects, records)
        assert note.startswith('effects.warm: the recording has no extra/temp')
    assert unmeasured_inputs(effects, [has]) == ()
    assert unmeasured_inputs(law_of('rate/joint_2'), [lacks]) == ()
    assert unmeasured_inputs(arm_file().effects, [lacks]) == ()


def test_a_column_that_some_recordings_lack_is_said():
    has, lacks = SimpleNamespace(inputs={'extra/temp': None}), SimpleNamespace(inputs={})
    (note,) = unshared_extras([has, lacks])
    assert note == 'extra/temp: not in every recording, so that no law is asked of it'
    assert unshared_extras([has, has]) == ()
