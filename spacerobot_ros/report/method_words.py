"""What is said of the way in which data were held against the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..diagnosis.answer.result import Method
from ..diagnosis.score_on import BAND

_UNKNOWN = 'what no cause explains'
_NO_TEST = f'Not tested: the level of {_UNKNOWN} comes from the data.'
_ALONE = 'each against the model as it stands'
_SHADOWS = (
    'The second best is often the shadow of the best: what counts is what the data still want '
    'once a cause is in.'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodWords:
    """Sentences about a method, and about its figures.

    Args:
        how: All of it.
        unit: Held-out errors are in standard deviations of this.
        floor: What a noise floor is.
        signals: What measured and simulated values are; where none are, why.
        errors: Caption of all errors; empty where each kind of channel has its own.
        time: What errors are drawn against.
        ranked: What single effects are compared with. remark: On such ranks.
        nothing_left: Said where no channel stands out.
    """

    how: str
    unit: str = 'the noise'
    floor: str = 'what a right model has'
    signals: str
    errors: str = ''
    time: str = 'time [s]'
    ranked: str = _ALONE
    remark: str = ''
    nothing_left: str = _NO_TEST


WORDS: Mapping[Method, MethodWords] = {
    'prediction': MethodWords(
        how='An error-state filter predicts every sample of every sensor from the model and the '
        'measured joint torques, one step ahead, with the noise of the sensors taken through. '
        'Every effect of the catalogue at every place is one column of such predictions; which '
        'columns the errors want is asked of the whole record by evidence, and fifths of it must '
        'be better predicted with them by what the other four say. Held-out errors are those of '
        'each fifth of the record with the values that the other four give. A placebo is the same '
        'column with its seconds shuffled: what it explains, any extension of that size would. A '
        'cause counts when it beats chance over the whole catalogue and its price in parameters, '
        'improves what is held out by more than its placebos, and stays the same along the record '
        'as far as the errors let that be seen; it is named when it is also large enough to '
        'matter.',
        signals='Simulated means predicted one step ahead.',
        remark=_SHADOWS,
        nothing_left='Nothing: every channel is down to its noise floor and white.',
    ),
    'balance': MethodWords(
        how='The torques that the model needs along the smoothed motion are compared with the '
        f'measured ones below {BAND:g} Hz, joint by joint where it moves; a joint at rest says '
        'nothing, since its friction holds any torque. Every effect of the catalogue at every '
        'place adds its own torques to the balance. What no cause explains has a level against '
        'frequency, estimated along, and a tolerance stands for what the file of any machine '
        'misses. A cause is named where its evidence exceeds the price of looking at all of them, '
        'where the parts of the data (recordings, or quarters of the only one) are better '
        'predicted with it from each other, by more than with columns without meaning, and where '
        'it lowers the rms error, too. Standard deviations are widened as far as the parts '
        'scatter. No fit was tested against sensor noise: explained is where no joint is left '
        'with more than tolerances alone make.',
        unit=_UNKNOWN,
        floor=f'the level of {_UNKNOWN}',
        signals='No sensor was predicted: torques were balanced along the measured motion.',
        errors=f'Torque on each joint that the model does not explain, below {BAND:g} Hz.',
        remark=_SHADOWS,
    ),
    'pose': MethodWords(
        how='The pose of the body is fitted window by window under the recorded commands, start '
        'and rate of each window free, all unknowns of the thrusters at once; commands act as '
        'late as leaves least. Standard deviations come from how windows scatter. A cause is '
        'named where it beats chance over all that were looked at, where every second window is '
        'better predicted with it from the others, and where it is large enough to matter. No '
        'fit and no placebo was tested.',
        unit=_UNKNOWN,
        signals='No sensor was predicted: the pose was fitted window by window.',
        ranked='each beside all others',
    ),
    'spin': MethodWords(
        how='The mean rates of the gyro are compared with the spin that the magnetometer sees, '
        'window by window. Errors of the gyro are chosen one by one where they lower the Bayesian '
        'information criterion and every second window is better predicted with them from the '
        'others. The axis that both sensors see is the one of the body, or of a board on which '
        'both sit. No fit and no placebo was tested.',
        signals='Measured are mean rates of windows, simulated those that the spin makes.',
        errors='Mean rate of each window, less what the spin makes of it.',
        time='window',
        nothing_left='Nothing above the noise floor; whether the rest is white was not tested.',
    ),
}
