"""The closed loop as processes of their own, in a domain of ROS where nobody else is."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Estimate, Tracking

from spacerobot_ros.model.loader import package_folder
from spacerobot_ros.nodes.program import NODES
from spacerobot_ros.ros.qos import LATCHED, SAMPLES
from spacerobot_ros.ros.session import Session, SessionError

from ..hidden.diagnosis_scenario import packaged
from .own_process import alone, begin, run

_SETTINGS = {
    'reference.repeat': 'true',
    'simulator.lockstep_timeout': '0.5',
    'simulator.real_time_factor': '0.25',  # four processes of a busy machine keep up with it
}
SETTLED = 1.0
"""s of stamps without a larger error, by an estimate, after which the loop has recovered."""
_ROUND = 20.0
"""s of stamps, of the motion: the loop that faults befall has followed it once, so that what is
seen after them is not an estimate that was still poor."""
_FINE = np.radians(0.5)  # rad; the largest error that counts as recovered
_PATIENCE = 240.0
"""s of wall time for the nodes to start, or to do anything; a busy machine takes a minute."""
LONGEST = 300.0
"""s of stamps, after which what is waited for does not come; an estimate takes 10, and more where
a busy machine has no time for the identifier, which lockstep does not wait for."""
_DOMAINS = range(60, 100)  # of ROS, for loops that run side by side


def resident(process: int | str) -> float:
    """Memory that a process has now [bytes]."""
    pages = Path(f'/proc/{process}/statm').read_text(encoding='ascii').split()[1]
    return int(pages) * float(os.sysconf('SC_PAGE_SIZE'))


class Loop:
    """Simulator, identifier, controller and monitor in processes, and who listens to them.

    Args:
        session: Of the listener.
        folder: Where the identifier saves.
        domain: Of ROS, where nobody else is.
        is_lockstep: Whether the simulator waits for commands.
    """

    def __init__(self, session: Session, folder: Path, domain: int, *, is_lockstep: bool) -> None:
        self._session, self._domain, self.is_lockstep = session, domain, is_lockstep
        settings = {
            **_SETTINGS,
            'identifier.save_file': folder / 'saved',
            'simulator.lockstep': str(is_lockstep).lower(),
        }
        path = package_folder('spacerobot_ros') / 'config' / 'servicer.yaml'
        self._arguments = ['--ros-args', '--log-level', 'fatal', '--params-file', str(path)]
        for name, value in settings.items():
            self._arguments += ['-p', f'{name}:={value}']
        self._context = multiprocessing.get_context('forkserver')
        self._processes: dict[str, Any] = {}
        robot = packaged('servicer').robot
        self.limits = robot.effort_limits
        self.noise = 6.0 * np.max(robot.sensors.joint_effort_std or 0.0)
        self.efforts = np.zeros(len(self.limits))  # applied, as joint states say
        self.command = np.zeros(len(self.limits))
        self.estimate: Estimate | None = None
        self.settled_since: float | None = None
        self._lasting = SETTLED
        self.stamp = self.commanded = 0.0  # s, newest of joint states and of commands
        self.worst = 0.0  # rad, largest error since the loop has recovered
        self.faults: dict[str, int] = {}
        listener = session.plain('listener')
        for kind, topic, qos, take in (
            (JointState, '/joint_states', SAMPLES, self._on_state),
            (JointState, '/joint_commands', SAMPLES, self._on_command),
            (Tracking, '/tracking', SAMPLES, self._on_tracking),
            (Estimate, '/estimate', LATCHED, self._on_estimate),
        ):
            listener.create_subscription(kind, topic, take, qos)

    def start(self, node: str) -> None:
        """Start a process."""
        clock = ['-p', 'use_sim_time:=true'] if node != 'simulator' else []
        self._processes[node] = self.run_beside(run, node, self._arguments + clock)

    def start_all(self) -> None:
        """Start all, and wait until they are at work."""
        for node in NODES:
            self.start(node)
        self.settle(_ROUND)

    def run_beside(self, work: Callable[..., object], *arguments: Any) -> Any:
        """Do something in a process that hears the nodes."""
        process = self._context.Process(
            target=begin, args=(self._domain, work, arguments), daemon=True
        )
        process.start()
        return process

    def end(self) -> None:
        """End all."""
        for node in [*self._processes]:
            self.kill(node)

    def kill(self, node: str) -> None:
        """End a process as nothing in it can prevent."""
        process = self._processes.pop(node)
        if not process.is_alive():
            self.count(f'{node} ended by itself')
        process.kill()
        process.join()

    def starve(self, node: str, seconds: float) -> None:
        """Give a process no processor for a while, and listen meanwhile."""
        late = time.monotonic() + seconds
        pid = self._processes[node].pid
        os.kill(pid, signal.SIGSTOP)
        try:
            self.until(lambda: time.monotonic() > late)
        finally:
            os.kill(pid, signal.SIGCONT)

    def settle(self, lasting: float = SETTLED) -> float:
        """Wait until the joints have followed closely for so long [s]; since which stamp [s]."""
        self.settled_since, self.worst, self._lasting = None, 0.0, lasting
        self.until(self.is_settled)
        return self.settled_since or 0.0

    def processor_time(self, node: str) -> float:
        """What a process has computed for [s]; on a machine that is not busy, since its start."""
        status = Path(f'/proc/{self._processes[node].pid}/stat').read_text(encoding='ascii')
        ticks = status.rpartition(')')[2].split()[11:13]
        return sum(int(tick) for tick in ticks) / os.sysconf('SC_CLK_TCK')

    def memory(self, node: str) -> float:
        """Memory that a process has now [bytes]."""
        return resident(self._processes[node].pid)

    def until(self, is_there: Callable[[], object]) -> float:
        """Listen until something is there; the time that it took [s].

        Raises:
            SessionError: the nodes stand still, or have gone on for long without it.
        """
        begun, late = time.monotonic(), self.stamp + LONGEST
        self._session.until(
            lambda: is_there() or self.stamp > late, lambda: (self.stamp, self.commanded)
        )
        if not is_there():
            raise SessionError('what was waited for does not come')
        return time.monotonic() - begun

    def is_past(self, stamp: float) -> bool:
        """Whether the plant's time is beyond a stamp [s]."""
        return self.stamp > stamp

    def is_settled(self) -> bool:
        """Whether the joints have followed closely for a while."""
        return self.settled_since is not None and self.stamp > self.settled_since + self._lasting

    def count(self, what: str) -> None:
        """Note that something went wrong."""
        self.faults[what] = self.faults.get(what, 0) + 1

    def _on_state(self, message: JointState) -> None:
        self.efforts = np.array(message.effort)
        self.stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9

    def _on_command(self, message: JointState) -> None:
        self.command = np.array(message.effort)
        self.commanded = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        if not np.all(np.abs(self.command) <= self.limits):
            self.count('commands beyond a limit')

    def _on_tracking(self, message: Tracking) -> None:
        if self.is_lockstep and message.state == 'damping':
            return  # a guess for the time in which a busy machine stands still: no plant has it
        follows = message.state == 'tracking' and message.uses_estimate
        if self.is_settled():
            self.worst = max(self.worst, message.max_error)
        elif not follows or message.max_error > _FINE:
            self.settled_since = None
        elif self.settled_since is None or self.settled_since > self.stamp:
            self.settled_since = self.stamp

    def _on_estimate(self, message: Estimate) -> None:
        self.estimate = message


@contextmanager
def loop_of_processes(*, is_lockstep: bool) -> Iterator[Loop]:
    """A loop that ends with the block; a SessionError there ends the block, and is counted."""
    listening = Session(_PATIENCE)
    with TemporaryDirectory() as folder, _own_domain() as domain, listening as session:
        loop = Loop(session, Path(folder), domain, is_lockstep=is_lockstep)
        try:
            yield loop
        except SessionError as error:
            loop.count(str(error))
        finally:
            loop.end()


@contextmanager
def _own_domain() -> Iterator[int]:
    """A domain of ROS in which no other loop of this machine is, for this process, too."""
    before = dict(os.environ)
    with ExitStack() as stack:
        for domain in _DOMAINS:
            lock = Path(gettempdir()) / f'spacerobot-domain-{domain}'
            file = stack.enter_context(lock.open('w', encoding='ascii'))
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
        else:
            raise SessionError('all domains of ROS for loops of processes are taken')
        os.environ.update(alone(domain))
        try:
            yield domain
        finally:
            os.environ.clear()
            os.environ.update(before)
