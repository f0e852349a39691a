"""What a node has learned, in a file: kept up to date, and taken up at the start.

The disk may take its time, or be full: nobody waits for it but who asks for the file.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import SpaceRobotError
from .base import RobotNode
from .beside import STOP, Beside


class KeptFile:
    """Saves and loads beside the callbacks, in lockstep at once; loads first of all what is there.

    Args:
        node: The node, which gets `~/save` and `~/load`.
        path: The file; empty: none.
        known: What is known now and worth a file; None: nothing.
        write: Writes that to a path, of a wall time [ns].
        read: Reads what a path knows at a wall time [ns].
        take: Goes on with that, among the callbacks.
    """

    def __init__(
        self,
        node: RobotNode,
        path: str,
        known: Callable[[], Any],
        write: Callable[[Path, Any, int], object],
        read: Callable[[Path, int], Any],
        take: Callable[[Any], object],
    ) -> None:
        self._node, self._path = node, path
        self._known, self._write, self._read, self._take = known, write, read, take
        self._beside = Beside(node, is_threaded=not node.settings.simulator.lockstep)
        self._newest: tuple[Any, int] = (None, 0)
        self._saved: Any = None
        self._has_looked = self._is_due = False  # at what there is to go on with; to be saved
        node.offer_later('~/save', self._on_save)
        node.offer_later('~/load', self._on_load)
        self._first = node.create_timer(0.0, self._at_start, clock=node.steady)
        if not self._beside.is_threaded:
            self._at_start()

    def keep(self) -> None:
        """Begin to save what is new, unless the disk is busy with what was before.

        What was new before the file had been looked for is saved after that.
        """
        known, since_ns = self._dated()
        is_news = known is not None and known is not self._saved
        if self._path and is_news:
            self._is_due = not self._has_looked or self._beside.is_busy
            if not self._is_due:
                self._beside.start(partial(self._put, known, since_ns), lambda _: None)

    def close(self) -> None:
        """Let the disk finish."""
        self._beside.end(STOP)

    async def _on_save(self) -> tuple[bool, str]:
        known, since_ns = self._dated()
        if known is None and self._path:
            return False, 'nothing new is known that is valid'
        return await self._done(partial(self._put, known, since_ns))

    async def _on_load(self) -> tuple[bool, str]:
        return self._go_on(await self._done(self._get))

    async def _done(self, work: Callable[[], tuple[Any, str]]) -> tuple[Any, str]:
        if not self._path:
            return None, 'save_file names no file'
        outcome: tuple[Any, str] = await self._beside.do(work)
        return outcome

    def _dated(self) -> tuple[Any, int]:
        """What is known, and since when [ns]: saved again, it shall not pass for younger."""
        known = self._known()
        if known is not self._newest[0]:
            self._newest = known, time.time_ns()
        return self._newest

    def _put(self, known: Any, since_ns: int) -> tuple[bool, str]:
        """Save; whether it is done, and what there is to say."""
        try:
            self._write(Path(self._path), known, since_ns)
        except SpaceRobotError as error:
            why = f'not saved: {error}'
            self._node.get_logger().error(why, throttle_duration_sec=5.0)
            return False, why
        self._saved = known
        return True, f'saved to {self._path}'

    def _get(self) -> tuple[Any, str]:
        """What the file knows, None for nothing, and what there is to say."""
        try:
            found = self._read(Path(self._path), time.time_ns())
        except SpaceRobotError as error:
            return None, f'not loaded: {error}'
        return found, f'goes on with what {self._path} knows'

    def _at_start(self) -> None:
        """Go on with the file that is there, once callbacks run, which do not wait for it."""
        self._first.cancel()
        self._has_looked = True
        self._beside.start(self._look, self._begin)

    def _look(self) -> tuple[Any, str]:
        """As `_get`, without a word where there is no file yet."""
        path = Path(self._path)
        is_there = self._path and any(path.parent.glob(f'{path.name}*'))
        return self._get() if is_there else (None, '')

    def _begin(self, outcome: tuple[Any, str]) -> None:
        _, why = self._go_on(outcome)
        if why:
            self._node.get_logger().info(why)
        if self._is_due:
            self.keep()

    def _go_on(self, outcome: tuple[Any, str]) -> tuple[bool, str]:
        found, why = outcome
        if found is not None:
            self._take(found)
        return found is not None, why
