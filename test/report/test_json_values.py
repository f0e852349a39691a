"""Results as JSON: a dataclass is its fields, with the names that it gives them."""

import json
from dataclasses import dataclass

import numpy as np

from spacerobot_ros.json_values import json_as, json_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    json_too = ('double',)
    value: float
    motion: str = json_as('with', default='rate')
    series: tuple[float, ...] = json_as(default=())

    @property
    def double(self):
        return 2.0 * self.value


@dataclass(frozen=True, slots=True)
class Outer:
    inner: tuple[Inner, ...]
    array: np.ndarray

    def to_json(self):
        return {'schema': 3, 'inner': self.inner, 'array': self.array}


def test_a_result_is_its_fields_and_the_properties_that_it_names():
    inner = Inner(value=np.inf, series=(1.0,))
    said = json.loads(
        json_text({'all': Outer((inner, Inner(value=1.5)), np.array([1.0, np.nan]))})
    )
    first = {'value': None, 'with': 'rate', 'double': None}
    second = {'value': 1.5, 'with': 'rate', 'double': 3.0}
    assert said == {'all': {'schema': 3, 'inner': [first, second], 'array': [1.0, None]}}
    assert list(said['all']['inner'][0]) == ['value', 'with', 'double']
