"""From the posterior of bodies and momenta to an `Estimate`: what is known, from where, valid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.unknowns.body_coordinates import PARTS
from ..estimation.unknowns.minimal import minimal_set
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..types import Array
from . import validity_limits as limits
from .estimate import Estimate, NamedValue
from .maximum_likelihood import MaximumLikelihood
from .momentum_posterior import MomentumPosterior, prior_of

_WORDS = {'mass': 'mass', 'com': 'centre of mass', 'inertia': 'inertia'}
_MEASURES = {'com': 'radius of gyration', 'inertia': 'extent'}


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """What a solution came from.

    Args:
        samples: Number of joint samples.
        stamp_ns: Time of the last one.
        notes: Remarks for the user.
        faults: What is wrong with the sensors.
    """

    samples: int
    stamp_ns: int
    notes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """An estimate with the bodies behind it.

    Args:
        estimate: Wheel momentum and minimal parameters.
        robot: The robot with the bodies and the wheel momentum found; None of `ls`.
        model: Of the unknowns. posterior: Of them; both None where bodies were not sought.
        limit: Largest deviation of the wheel momentum that is valid [N m s].
    """

    estimate: Estimate
    robot: Robot | None = None
    model: MomentumModel | None = None
    posterior: MomentumPosterior | None = None
    limit: float = np.inf


def conclude(likelihood: MaximumLikelihood, method: str, source: Source) -> Identification:
    """The estimate, and why it is not valid where it is not.

    Args:
        likelihood: What was found.
        method: Its name.
        source: From what.
    """
    model, posterior = likelihood.model, likelihood.posterior()
    far = contradictions_of_file(model, posterior)
    reason = '; '.join(source.faults) or _doubt(likelihood, far)
    estimate = Estimate(
        method=method,
        valid=not reason,
        reason=reason,
        rank=posterior.rank,
        condition=_condition(posterior.covariance[3:, 3:]),
        unexcited=from_the_file(model, posterior),
        chi2_per_dof=likelihood.chi2_per_dof,
        samples=source.samples,
        stamp_ns=source.stamp_ns,
        notes=(*source.notes, *_notes(model, posterior, far)),
        **estimated_values(model, posterior),
    )
    robot, limit = model.robot_at(posterior.mean), likelihood.limit
    return Identification(estimate, robot, model, posterior, limit)


def estimated_values(model: MomentumModel, posterior: MomentumPosterior) -> dict[str, Any]:
    """The fields of an `Estimate` that constants and their covariance make."""
    minimal = minimal_set(model.robot, model.structure)
    mean, covariance = posterior.mean, posterior.covariance
    head, n = slice(3, model.y.stop), model.n_aam
    slopes = model.bodies.derivatives(minimal.of_bodies, mean[model.y])
    wanted = np.zeros((n + len(minimal), n + model.bodies.size))
    wanted[:n, :n], wanted[n:, n:] = np.eye(n), slopes
    found = wanted @ covariance[head, head] @ wanted.T
    wheels, bodies = posterior.prior_std[model.aam] ** 2, posterior.prior_std[model.y] ** 2
    prior = np.concatenate([wheels, slopes**2 @ bodies])
    own, other = model.nuisances, model.other
    std = np.sqrt(np.diag(covariance))[other]
    nuisances = zip(own.names, mean[other].tolist(), std.tolist(), own.units, strict=True)
    mass, com, inertia = model.bodies.bodies(mean[model.y])
    return {
        'aam_links': tuple(g.link for g in model.robot.target_wheels),
        'aam': mean[model.aam],
        'parameter_names': minimal.names,
        'parameters': minimal.of_bodies(mass, com, inertia),
        'units': minimal.units,
        'covariance': 0.5 * (found + found.T),
        'sources': sources(np.diag(found), prior),
        'total_momentum': mean[:3],
        'total_momentum_covariance': covariance[:3, :3],
        'nuisances': tuple(NamedValue(*each) for each in nuisances),
        'unknowns': model.size,
        'prior_factor': posterior.factor,
    }


def sources(variance: Array, prior: Array) -> tuple[str, ...]:
    """What numbers are from, by how much data shrank their variance (k,) below the prior's."""
    told = 1.0 - variance / np.where(prior > 0.0, prior, 1.0)
    words = np.where(
        told > limits.FROM_DATA, 'data', np.where(told < limits.FROM_FILE, 'file', 'both')
    )
    return tuple(words.tolist())


def from_the_file(model: MomentumModel, posterior: MomentumPosterior) -> tuple[str, ...]:
    """What only the robot file tells of the bodies, in a few lines, such as `link_2: mass`."""
    variance = np.diag(posterior.covariance)[model.y]
    is_untold = np.zeros(model.bodies.free.shape, dtype=bool)
    from_where = np.array(sources(variance, posterior.prior_std[model.y] ** 2))
    is_untold[model.bodies.free] = from_where == 'file'
    lines: dict[str, list[str]] = {}
    for body, own in zip(model.robot.bodies, is_untold, strict=True):
        parts = [words for part, words in _WORDS.items() if own[np.array(PARTS) == part].all()]
        if parts:
            lines.setdefault(', '.join(parts), []).append(body.name)
    texts = [f'{", ".join(names)}: {parts}' for parts, names in lines.items()]
    if len(texts) > limits.MOST_LINES:
        rest = len(texts) - limits.MOST_LINES + 1
        texts = [*texts[: limits.MOST_LINES - 1], f'and some of {rest} other sets of bodies']
    return tuple(texts)


def contradictions_of_file(model: MomentumModel, posterior: MomentumPosterior) -> tuple[str, ...]:
    """Bodies that are further from the file's than it says they may be, in words.

    By how far they are at least, two deviations off what was found.
    """
    y, std = posterior.mean[model.y], np.sqrt(np.diag(posterior.covariance))[model.y]
    far = (np.abs(y) - 2.0 * std) / model.bodies.std
    body, part = np.nonzero(model.bodies.free)
    lines: dict[int, str] = {}
    for i in np.argsort(-far)[: int(np.sum(far > limits.CONTRADICTED))].tolist():
        name, kind = model.robot.bodies[body[i]].name, PARTS[part[i]]
        size = f'off by {abs(y[i]):.2g} of its {_MEASURES.get(kind)}'
        if kind == 'mass':
            size = f"{np.exp(y[i]):.3g} times the file's"
        stated = f'{abs(y[i]) / model.bodies.std[i]:.2g} of the deviations that the file states'
        lines.setdefault(int(body[i]), f'{name}: {_WORDS[kind]} {size}, {stated}')
    return tuple(lines.values())


def unexplained(chi2_per_dof: float) -> str:
    """What to say of a misfit."""
    why = 'the model does not explain the data: chi2 per degree of freedom is'
    return f'{why} {chi2_per_dof:.3g}'


def too_weak(std: float, limit: float) -> str:
    """What to say of wheel momentum that is not known well enough."""
    return f'wheel momentum is known to {std:.3g} N m s only, the limit is {limit:.3g}'


def nothing_known(
    model: MomentumModel, settings: IdentifierSettings, reason: str, stamp_ns: int
) -> Estimate:
    """The prior as an estimate that is not valid, for a reason, at a stamp [ns]."""
    mean, std = prior_of(model, settings.momentum_prior_std, np.zeros(3), None)
    return Estimate(
        method='online',
        valid=False,
        reason=reason,
        rank=0,
        condition=float('inf'),
        unexcited=('everything',),
        chi2_per_dof=0.0,
        samples=0,
        stamp_ns=stamp_ns,
        **estimated_values(model, MomentumPosterior(mean, np.diag(std**2), std)),
    )


def _condition(covariance: Array) -> float:
    """Square root of the condition number of the correlations."""
    std = np.sqrt(np.diag(covariance))
    values = np.linalg.eigvalsh(covariance / np.outer(std, std))
    return float(np.sqrt(values[-1] / max(values[0], np.finfo(float).tiny)))


def _doubt(likelihood: MaximumLikelihood, far: tuple[str, ...]) -> str:
    """Why the data do not suffice; empty where they do."""
    posterior = likelihood.posterior()
    if likelihood.chi2_per_dof > limits.LARGEST_CHI2 and likelihood.is_settled:
        return unexplained(likelihood.chi2_per_dof)
    if posterior.above > 0.5:
        which = f' ({far[0]})' if far else ''
        return f'the data contradict the bodies of the robot file{which}'
    if not likelihood.is_settled:
        return 'the iteration has not converged'
    std = np.sqrt(np.diag(posterior.covariance))[likelihood.model.aam]
    limit = likelihood.limit
    return too_weak(float(np.max(std)), limit) if np.any(std > limit) else ''


def _notes(
    model: MomentumModel, posterior: MomentumPosterior, far: tuple[str, ...]
) -> tuple[str, ...]:
    notes = [f'the file is contradicted: {line}' for line in far[: limits.MOST_LINES]]
    if far:
        notes.append(
            f'the data scale the uncertainties of the file by {posterior.factor:.2g}: '
            'robot.uncertainty says how sure the file is, by link where it differs'
        )
    if not np.any(model.robot.servicer_wheels.body_momentum):
        notes.append(
            "the servicer's own wheels are at rest, so the common scale of all numbers is the "
            "file's; the data tell ratios"
        )
    aam, part = posterior.mean[model.aam], model.aam
    if len(aam):
        square = float(aam @ np.linalg.solve(posterior.covariance[part, part], aam))
        if square < limits.NO_MOMENTUM * len(aam):
            std = np.max(np.sqrt(np.diag(posterior.covariance)[part]))
            notes.append(f'wheel momentum: none, within +- {std:.2g} N m s')
    return tuple(notes)
