"""Drake: `Simulator` over a continuous `MultibodyPlant`, fixed and error-controlled steps."""

from __future__ import annotations

from importlib.metadata import version

import harness
import numpy as np
import servicer
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial


class Machine:
    """A plant at the start of a run, with a simulator and, if smooth, a source of torques."""

    def __init__(self, scenario: str, scheme: str, step: float, accuracy: float) -> None:
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(_plant())
        if scenario == 'smooth':
            # A cubic spline, evaluated in C++: 2 ms apart it is exact to 1e-12.
            times = np.arange(0.0, servicer.DURATION + 0.01, 2e-3)
            curve = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
                times, np.array([servicer.torque(t) for t in times]).T
            )
            source = builder.AddSystem(TrajectorySource(curve))
            builder.Connect(source.get_output_port(), self.plant.get_actuation_input_port())
        self.simulator = Simulator(builder.Build())
        context = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(context)
        self._place()
        integrator = ResetIntegratorFromFlags(self.simulator, scheme, step)
        integrator.set_fixed_step_mode(not accuracy)
        if accuracy:
            integrator.set_target_accuracy(accuracy)
        self.hold((0.0, 0.0, 0.0), scenario)
        self.simulator.Initialize()
        self.run_to = self.simulator.AdvanceTo

    def hold(self, torques: tuple[float, float, float], scenario: str = 'held') -> None:
        """Torques from now on."""
        if scenario == 'held':
            self.plant.get_actuation_input_port().FixValue(self.context, np.array(torques))

    def state(self) -> tuple:
        """What `harness.run_seconds` asks for."""
        base = self.plant.GetBodyByName('base')
        pose = self.plant.EvalBodyPoseInWorld(self.context, base)
        twist = self.plant.EvalBodySpatialVelocityInWorld(self.context, base)
        joints = [self.plant.GetJointByName(f'j_{name}') for name in servicer.JOINTS]
        w, x, y, z = pose.rotation().ToQuaternion().wxyz()
        q = [joint.get_angle(self.context) for joint in joints]
        qd = [joint.get_angular_rate(self.context) for joint in joints]
        R = pose.rotation().matrix()
        return R, twist.rotational(), twist.translational(), q, qd, (x, y, z, w)

    def _place(self) -> None:
        x, y, z, w = servicer.ATTITUDE_XYZW
        base, R = self.plant.GetBodyByName('base'), servicer.rotation_matrix((x, y, z, w))
        pose = RigidTransform(Quaternion(np.array([w, x, y, z])), np.zeros(3))
        self.plant.SetFreeBodyPose(self.context, base, pose)
        twist = SpatialVelocity(R @ servicer.OMEGA_B, np.zeros(3))
        self.plant.SetFreeBodySpatialVelocity(base, twist, self.context)
        for name, rate in zip(servicer.JOINTS, servicer.RATES, strict=True):
            self.plant.GetJointByName(f'j_{name}').set_angular_rate(self.context, float(rate))


def _plant() -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    Parser(plant).AddModelsFromString(servicer.urdf(), 'urdf')
    for name in servicer.JOINTS[:3]:
        plant.AddJointActuator(f'm_{name}', plant.GetJointByName(f'j_{name}'))
    plant.Finalize()
    return plant


def run(scenario: str, scheme: str, step: float, accuracy: float) -> harness.Outcome:
    """One run; a held one stops at every control period to change the torques."""
    machine = Machine(scenario, scheme, step, accuracy)
    return harness.stepped(machine, scenario, machine.state)


def settings() -> list[harness.Setting]:
    """Steps and accuracies from coarse to fine."""
    fixed = [('runge_kutta3', step, 0.0) for step in (1e-2, 5e-3, 2e-3, 1e-3)]
    fixed += [('runge_kutta5', step, 0.0) for step in (5e-2, 2e-2, 1e-2)]
    controlled = [('runge_kutta5', 0.1, accuracy) for accuracy in (1e-6, 1e-9, 1e-12)]
    return [
        (
            scenario,
            f'{scheme} {f"accuracy {accuracy:g}" if accuracy else f"{1e3 * step:g} ms"}',
            lambda s=scenario, a=(scheme, step, accuracy): run(s, *a),
        )
        for scenario in servicer.SCENARIOS
        for scheme, step, accuracy in (*fixed, *controlled)
        if scenario == 'smooth' or accuracy or step <= servicer.PERIOD
    ]


if __name__ == '__main__':
    harness.report('Drake', version('drake'), settings())
