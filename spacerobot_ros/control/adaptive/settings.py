"""Settings of one adaptive law."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from ...model.settings import ADAPTIVE_LAWS as LAWS
from ...model.settings import CONSISTENCIES, AdaptationSettings, Settings


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


__all__ = ['CONSISTENCIES', 'LAWS', 'AdaptiveSettings']
