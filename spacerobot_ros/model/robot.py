"""The immutable robot that every other part takes: a tree of bodies, wheels, sensors' noise.

Bodies are numbered: body 0 is the base, body i (1..n) moves with joint i of `Robot.joints`, in
that order everywhere. Links joined by fixed joints are one body. A body's frame is the frame of
its joint's child link (the base: the frame of `base_link`).

Wheels come in two views of one robot. The *gyrostat view*, which controllers and identifiers use,
has the wheels locked: their mass and inertia belong to the carrying body and their spin is a
constant relative momentum. The *plant view* (`with_free_rotors`) has rotors as bodies of their own
behind the arm joints. In the URDF a link's inertia includes its gyrostat wheels, locked, and
excludes its true rotors, which are links of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..errors import ConfigurationError
from ..types import Array, BoolArray, Vector3
from .body import Body, Gyrostat, Rotor, joint_unit, last_bodies, tree_order
from .inputs import Inputs, MountedThruster
from .rigid_body import Solid
from .robot_settings import SensorSettings
from .uncertainty import USUAL, BodyUncertainty
from .urdf import Tree, parse_urdf


@dataclass(frozen=True, eq=False)
class Robot:
    """A validated robot. Build one with `load_robot_file`; vary one with the `with_*` methods.

    Args:
        name: Name of the URDF.
        urdf: The URDF text that the robot was built from.
        is_free: Free-floating base (True) or fixed base (False).
        gravity: (3,) in the inertial frame [m/s^2].
        joints: Names of the n manipulator joints, then of the rotors if `rotor_count` > 0.
        bodies: Body 0 (base) and one body a joint.
        servicer_wheels: Gyrostat of the base.
        target_wheels: Gyrostats of the captured body (what the model believes).
        effort_limits: (n,) [N m], infinite where the URDF has none.
        velocity_limits: (n,) [rad/s], infinite where the URDF has none.
        position_limits: (n, 2) [rad], infinite where the URDF has none.
        sensors: Sensor noise.
        rotors: True rotors, the servicer's first; locked into `bodies` unless `rotor_count` > 0.
        rotor_count: Number of trailing entries of `joints` that are free rotors: 0 in the gyrostat
            view, `len(rotors)` in the plant view.
        inertia_uncertainty: Standard deviation of every inertial parameter, as a share of it, in
            the diagnosis.
        uncertainties: Of each body, rotors aside; see `uncertainty_of`.
        uncertain_bodies: Those that the file states it of by name.
        effort_kinds: What the measured effort of each joint of the arm is, see `RobotSettings`.
        motor_constants: Of each joint of the arm [N m/A]; empty where they are not stated.
        passive_joints: Joints of the arm without a motor.
        thrusters: On the base.
        inputs: What acts on the base in the run that it is asked about; None: nothing known.
        rate_only: Joints of whose motion a recording has only the rates.
        anchor: What of the file is right where no torque is measured, see `ScaleSettings`.
        held: Position of each joint of the URDF that does not move [rad or m].
        friction: Of joints, believed, by effect and joint: so much a diagnosis may find absent.
    """

    name: str
    urdf: str
    is_free: bool
    gravity: Vector3
    joints: tuple[str, ...]
    bodies: tuple[Body, ...]
    servicer_wheels: Gyrostat
    target_wheels: tuple[Gyrostat, ...]
    effort_limits: Array
    velocity_limits: Array
    position_limits: Array
    sensors: SensorSettings
    rotors: tuple[Rotor, ...] = ()
    rotor_count: int = 0
    inertia_uncertainty: float = 0.1
    uncertainties: tuple[BodyUncertainty, ...] = ()
    uncertain_bodies: frozenset[int] = frozenset()
    effort_kinds: tuple[str, ...] = ()
    motor_constants: tuple[float, ...] = ()
    passive_joints: tuple[str, ...] = ()
    thrusters: tuple[MountedThruster, ...] = ()
    inputs: Inputs | None = None
    rate_only: tuple[str, ...] = ()
    anchor: str = 'none'
    held: Mapping[str, float] = field(default_factory=dict)
    friction: Mapping[tuple[str, str | None], float] = field(default_factory=dict)

    @property
    def tree(self) -> Tree:
        """Links and joints of the URDF, those that are held fixed."""
        return parse_urdf(self.urdf, is_on_ground=not self.is_free, held=self.held)

    @property
    def without_constant(self) -> tuple[str, ...]:
        """Joints whose efforts are currents, torques of which nobody states."""
        return () if self.motor_constants else self.with_current

    @property
    def with_current(self) -> tuple[str, ...]:
        """Joints with a motor whose efforts are currents."""
        kinds = zip(self.arm, self.effort_kinds, strict=True) if self.effort_kinds else ()
        return tuple(j for j, kind in kinds if kind == 'current' and j not in self.passive_joints)

    @property
    def effort_units(self) -> Array:
        """(n,) torque at each joint of the arm of one unit of its effort in a message [N m].

        The motor constant of a joint whose effort is a current, 1 of every other.

        Raises:
            ConfigurationError: the motor constants are not stated.
        """
        self.check_constants()
        return self.known_effort_units

    def check_constants(self) -> None:
        """Refuse currents whose torques nobody states.

        Raises:
            ConfigurationError: the motor constants are not stated.
        """
        if self.without_constant:
            names = ', '.join(self.without_constant)
            raise ConfigurationError(
                'robot.motor_constant',
                f'is missing: efforts of {names} are currents, state N m/A of each joint',
            )

    @property
    def known_effort_units(self) -> Array:
        """(n,) as `effort_units`; 1 where efforts stay in amperes (`without_constant`)."""
        if not self.motor_constants:
            return np.ones(len(self.arm))
        currents = [kind == 'current' for kind in self.effort_kinds]
        return np.where(currents, self.motor_constants, 1.0)

    def effort_kind(self, joint: str) -> str:
        """What the measured effort of a joint of the arm is."""
        return self.effort_kinds[self.arm.index(joint)] if self.effort_kinds else 'motor'

    def unit_of(self, unit: str, *joints: str) -> str:
        """Unit of a quantity of joints, such as `N` for `N m` of one that slides.

        Args:
            unit: Of joints that turn.
            joints: Whose it is; all joints of the arm where none is named.
        """
        bodies = (self.bodies[1 + self.joints.index(joint)] for joint in joints or self.arm)
        return joint_unit(unit, {body.is_prismatic for body in bodies} or {False})

    def ways(self, joints: Iterable[str]) -> dict[str, str]:
        """Unit of what each of some joints moves by."""
        return {joint: self.unit_of('rad', joint) for joint in joints}

    @property
    def n_joints(self) -> int:
        """Number of joints, rotors included."""
        return len(self.joints)

    @property
    def arm(self) -> tuple[str, ...]:
        """Names of the manipulator's joints."""
        return self.joints[: self.n_joints - self.rotor_count]

    @property
    def base_link(self) -> str:
        """Name of the base's frame."""
        return self.bodies[0].name

    @property
    def gyrostats(self) -> tuple[Gyrostat, ...]:
        """All gyrostats, the servicer's first."""
        return (self.servicer_wheels, *self.target_wheels)

    @property
    def target_momentum(self) -> Array:
        """(3 n_links,) the captured body's wheel momentum, rotors at their first rates [N m s]."""
        return np.concatenate(
            [np.zeros(0), *(g.momentum + self._free_momentum(g, True) for g in self.target_wheels)]
        )

    @property
    def servicer_momentum(self) -> Vector3:
        """(3,) momentum of the servicer's wheels, rotors at their first rates [N m s]."""
        return self.servicer_wheels.momentum + self._free_momentum(self.servicer_wheels, False)

    @property
    def rotor_rates(self) -> Array:
        """(rotor_count,) relative rates of the free rotors at the start [rad/s]."""
        return np.array([rotor.rate for rotor in self.rotors[: self.rotor_count]])

    def uncertainty_of(self, index: int) -> BodyUncertainty:
        """Of a body by its place in `bodies`; the usual one where none is stated, as of rotors."""
        return self.uncertainties[index] if index < len(self.uncertainties) else USUAL

    @cached_property
    def inertial_parameters(self) -> Array:
        """(n + 1, 10) of every body about its own frame, in the order of `Solid.row`."""
        return np.array([b.solid.row for b in self.bodies])

    @cached_property
    def moves(self) -> BoolArray:
        """(n, n + 1) whether joint j moves body k."""
        moves = np.zeros((self.n_joints, len(self.bodies)), dtype=bool)
        for k in range(1, len(self.bodies)):
            ancestor = k
            while ancestor:
                moves[ancestor - 1, k] = True
                ancestor = self.bodies[ancestor].parent
        return moves

    @property
    def last_links(self) -> list[str]:
        """Links that carry no other, where loads are: one at the end of every arm."""
        return [self.bodies[i].name for i in last_bodies(self.bodies)]

    def with_target_momentum(self, momentum: Array, place: str = 'target wheel momentum') -> Robot:
        """The same robot believing another wheel momentum of the captured body.

        Args:
            momentum: (3 n_links,) link after link, each in its link frame [N m s].
            place: What to call it in error messages.

        Raises:
            ConfigurationError: wrong length or not finite.
        """
        momentum = _finite(momentum, (3 * len(self.target_wheels),), place)
        wheels = tuple(
            replace(g, momentum=momentum[3 * i : 3 * i + 3].copy())
            for i, g in enumerate(self.target_wheels)
        )
        return replace(self, target_wheels=wheels)

    def with_servicer_momentum(
        self, momentum: Array, place: str = 'servicer wheel momentum'
    ) -> Robot:
        """The same robot with another momentum of its own wheels, (3,) in base_link [N m s]."""
        momentum = _finite(momentum, (3,), place)
        return replace(self, servicer_wheels=replace(self.servicer_wheels, momentum=momentum))

    def with_inertial_parameters(self, parameters: Array) -> Robot:
        """The same robot with other masses, centres of mass and inertias.

        Args:
            parameters: (n + 1, 10) as `inertial_parameters`; not checked for physical consistency.
        """
        parameters = _finite(parameters, (len(self.bodies), 10), 'inertial parameters')
        bodies = tuple(
            body.with_solid(Solid.of_row(row))
            for body, row in zip(self.bodies, parameters, strict=True)
        )
        return replace(self, bodies=bodies)

    def with_motor_inertia(self, joint: str, inertia: float) -> Robot:
        """The same robot, a joint's motor of more inertia than it has [kg m^2]."""
        index = 1 + self.joints.index(joint)
        body = self.bodies[index]
        return self.with_body(index, replace(body, motor_inertia=body.motor_inertia + inertia))

    def with_body(self, index: int, body: Body) -> Robot:
        """The same robot with another body at a place in `bodies`."""
        return replace(self, bodies=(*self.bodies[:index], body, *self.bodies[index + 1 :]))

    def with_free_rotors(self, rates: Array) -> Robot:
        """The plant view: rotors become joints, and leave their hosts' inertia and gyrostats.

        Args:
            rates: (n_rotors,) relative rates at the start, in the order of `rotors` [rad/s].

        Raises:
            ConfigurationError: wrong length or not finite.
        """
        rates = _finite(rates, (len(self.rotors),), 'rotor rates')
        if not self.rotors or self.rotor_count:
            return self
        bodies = list(self.bodies)
        for rotor in self.rotors:
            bodies[rotor.body.parent] = bodies[rotor.body.parent].without(rotor.body)
        n = len(self.rotors)
        unlimited = np.full(n, np.inf)
        return replace(
            self,
            joints=(*self.joints, *(rotor.joint for rotor in self.rotors)),
            bodies=(*bodies, *(rotor.body for rotor in self.rotors)),
            servicer_wheels=self._without_rotors(self.servicer_wheels, False),
            target_wheels=tuple(self._without_rotors(g, True) for g in self.target_wheels),
            effort_limits=np.concatenate([self.effort_limits, unlimited]),
            velocity_limits=np.concatenate([self.velocity_limits, unlimited]),
            position_limits=np.vstack([self.position_limits, np.outer(unlimited, [-1.0, 1.0])]),
            rotors=tuple(
                replace(r, rate=float(rate)) for r, rate in zip(self.rotors, rates, strict=True)
            ),
            rotor_count=n,
        )

    def _without_rotors(self, gyrostat: Gyrostat, is_target: bool) -> Gyrostat:
        is_rotors = any(r.is_target == is_target for r in self.rotors)
        return replace(gyrostat, momentum=np.zeros(3)) if is_rotors else gyrostat

    def _free_momentum(self, gyrostat: Gyrostat, is_target: bool) -> Vector3:
        rotors = [r for r in self.rotors[: self.rotor_count] if r.is_target == is_target]
        own = (r.body_momentum for r in rotors if r.link == gyrostat.link)
        return np.asarray(gyrostat.rotation.T @ sum(own, np.zeros(3)))


def _finite(values: Array, shape: tuple[int, ...], what: str) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise ConfigurationError(what, f'expected shape {shape}, got {array.shape}')
    if not np.all(np.isfinite(array)):
        raise ConfigurationError(what, 'is not finite')
    return array


__all__ = ['Body', 'Gyrostat', 'Robot', 'Rotor', 'tree_order']
