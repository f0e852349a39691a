"""Settings of one adaptive law, and how fast they may be for a control period."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from ...errors import ConfigurationError
from ...model.control_settings import AdaptationSettings
from ...model.settings import Settings

SLOW_ENOUGH = 0.7  # (kappa + Lambda) T up to which tracking is as in continuous time
LIMIT = 1.2  # from which held torques make the loop oscillate


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSettings(AdaptationSettings):
    """Section `adaptive` of the robot file, and the choice of law in section `controller`."""

    law: str = 'adaptive_composite'
    physical_consistency: str = 'project'

    @classmethod
    def of(cls, settings: Settings) -> AdaptiveSettings:
        """What the settings of a robot file ask for."""
        controller = settings.controller
        return cls(
            law=controller.law,
            physical_consistency=controller.physical_consistency,
            **asdict(settings.adaptive),
        )


def sampling_ratio(settings: AdaptiveSettings, period: float) -> float:
    """(kappa + Lambda) x period, with the larger Lambda."""
    fastest = max(settings.attitude_bandwidth, settings.joint_bandwidth)
    return (settings.kappa + fastest) * period


def sampling_warning(settings: AdaptiveSettings, period: float) -> str:
    """What is wrong with the bandwidths for this period; empty where nothing is.

    Torques are held over a period. A double integrator under held torques is unstable from
    (kappa + Lambda) T = 2 on; with the robot's couplings it oscillates from 1.2 to 1.5 on.

    Raises:
        ConfigurationError: beyond that limit, unless `sampling_check` is `warn`.
    """
    ratio = sampling_ratio(settings, period)
    if ratio <= SLOW_ENOUGH:
        return ''
    text = (
        f'(kappa + Lambda) x period = {ratio:.3g} is above {SLOW_ENOUGH:g}: choose lower '
        f'bandwidths or a shorter period than {period:g} s'
    )
    if ratio > LIMIT and settings.sampling_check == 'refuse':
        raise ConfigurationError('adaptive.kappa', text)
    return text
