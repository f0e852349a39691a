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
from .momentum_posterior import MomentumPosterior

_WORDS = {'mass': 'mass', 'com': 'centre of mass', 'inertia': 'inertia'}
_MEASURES = {'com': 'radius of gyration', 'inertia': 'extent'}


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """What a method found.

    Args:
        method: Its name.
        posterior: Of the constants.
        chi2_per_dof: Residual chi-square per degree of freedom.
        joint_share: Largest momentum that the joints' motion alone had [N m s].
        doubt: Why it is not valid, whatever the data say; empty where nothing is.
    """

    method: str
    posterior: MomentumPosterior
    chi2_per_dof: float
    joint_share: float
    doubt: str = ''


def finding_of(likelihood: MaximumLikelihood, method: str) -> Finding:
    """What maximum likelihood has found so far."""
    posterior, (squares, rows) = likelihood.posterior(), likelihood.misfit
    chi2 = squares / max(rows - posterior.rank, 1)
    is_done = likelihood.is_converged and posterior.is_settled
    doubt = '' if is_done else 'the iteration has not converged'
    return Finding(method, posterior, chi2, likelihood.joint_share, doubt)


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
    """

    estimate: Estimate
    robot: Robot | None = None
    model: MomentumModel | None = None
    posterior: MomentumPosterior | None = None


def conclude(
    model: MomentumModel, settings: IdentifierSettings, finding: Finding, source: Source
) -> Identification:
    """The estimate, and why it is not valid where it is not.

    Args:
        model: Robot and unknowns.
        settings: Limits of validity.
        finding: What was found.
        source: From what.
    """
    posterior = finding.posterior
    far = contradictions_of_file(model, posterior)
    reason = '; '.join(source.faults) or _doubt(model, settings, finding, far)
    estimate = Estimate(
        method=finding.method,
        valid=not reason,
        reason=reason,
        rank=posterior.rank,
        unknowns=model.size,
        condition=_condition(posterior.covariance[3:, 3:]),
        unexcited=from_the_file(model, posterior),
        chi2_per_dof=finding.chi2_per_dof,
        samples=source.samples,
        stamp_ns=source.stamp_ns,
        notes=(*source.notes, *_notes(model, posterior, far)),
        prior_factor=posterior.bodies.factor,
        **estimated_values(model, posterior),
    )
    return Identification(estimate, model.robot_at(posterior.mean), model, posterior)


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
    minimal, prior = minimal_set(model.robot, model.structure), model.prior()
    slopes = model.bodies.derivatives(minimal.of_bodies, prior[model.y])
    wheels = np.full(model.n_aam, settings.momentum_prior_std**2)
    return Estimate(
        method='online',
        valid=False,
        reason=reason,
        aam_links=tuple(g.link for g in model.robot.target_wheels),
        aam=prior[model.aam],
        parameter_names=minimal.names,
        parameters=minimal.of_robot(model.robot),
        units=minimal.units,
        covariance=np.diag(np.concatenate([wheels, slopes**2 @ model.bodies.std**2])),
        rank=0,
        unknowns=model.size,
        condition=float('inf'),
        unexcited=('everything',),
        total_momentum=prior[:3],
        total_momentum_covariance=(10.0 * settings.momentum_prior_std) ** 2 * np.eye(3),
        chi2_per_dof=0.0,
        samples=0,
        stamp_ns=stamp_ns,
        sources=('file',) * (model.n_aam + len(minimal)),
    )


def _condition(covariance: Array) -> float:
    """Square root of the condition number of the correlations."""
    std = np.sqrt(np.diag(covariance))
    values = np.linalg.eigvalsh(covariance / np.outer(std, std))
    return float(np.sqrt(values[-1] / max(values[0], np.finfo(float).tiny)))


def _doubt(
    model: MomentumModel, settings: IdentifierSettings, finding: Finding, far: tuple[str, ...]
) -> str:
    """Why the data do not suffice; empty where they do."""
    posterior = finding.posterior
    if finding.chi2_per_dof > limits.LARGEST_CHI2 and not finding.doubt:
        return unexplained(finding.chi2_per_dof)
    if posterior.bodies.above > 0.5:
        which = f' ({far[0]})' if far else ''
        return f'the data contradict the bodies of the robot file{which}'
    if finding.doubt:
        return finding.doubt
    aam, std = posterior.mean[model.aam], np.sqrt(np.diag(posterior.covariance))[model.aam]
    limit = settings.valid_std * max(float(np.linalg.norm(aam)), finding.joint_share, 1e-9)
    if len(aam) and (largest := np.max(std)) > limit:
        return too_weak(float(largest), limit)
    return ''


def _notes(
    model: MomentumModel, posterior: MomentumPosterior, far: tuple[str, ...]
) -> tuple[str, ...]:
    notes = [f'the file is contradicted: {line}' for line in far[: limits.MOST_LINES]]
    if far:
        notes.append(
            f'the data scale the uncertainties of the file by {posterior.bodies.factor:.2g}: '
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
