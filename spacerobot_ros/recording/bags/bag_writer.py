"""Writing rosbag2 folders (mcap): any ROS 2 tool reads them, the same run gives the same bytes."""

from __future__ import annotations

import heapq
import os
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any
from zlib import crc32

from rosbags import interfaces as bags
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.rosbag2.storage_mcap import McapWriter

from ...errors import MessageRejectedError, RecordingError
from ..messages import stamp_ns
from .message_types import CanonicalMessages, composer, encoded, typestore

_VERSION = 9  # of the bag's metadata: Jazzy and later
_REORDER_NS = 500_000_000
_CHUNK_NS = 500_000_000  # the most that damage to a chunk costs; a killed process the order, too
_CHECKSUM_AT = 9 + 24  # of a chunk: after opcode and length, two times and a size
_NAME = (
    'recording'  # of the file inside the folder: the content must not depend on the folder's name
)
_FOREVER = bags.QosTime(9223372036, 854775807)


def check_target(path: str | Path, overwrite: bool) -> Path:
    """The folder that a bag may be written to.

    Args:
        path: Folder to create.
        overwrite: Whether a bag that is there may be replaced; anything else never is.

    Raises:
        RecordingError: something is there that must stay.
    """
    path = Path(path)
    if not path.exists() and not path.is_symlink():
        return path
    if not overwrite:
        raise RecordingError(str(path), 'exists already (--force replaces it)')
    if not (path / 'metadata.yaml').is_file():
        raise RecordingError(str(path), 'exists and is not a bag, so it is not replaced')
    return path


class _ChunkWriter(McapWriter):  # type: ignore[misc]  # rosbags is untyped
    """Chunks of half a second at most, on the disk as soon as they are full, with a checksum."""

    def write(self, connection: bags.Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message, after the half second before it."""
        if timestamp - self.chunk.message_start_time >= _CHUNK_NS:
            self.close_chunk()
        super().write(connection, timestamp, data)

    def close_chunk(self) -> None:
        """Write the chunk; the checksum, which `McapWriter` leaves out, where it belongs."""
        start, checksum = self.bio.tell(), crc32(self.chunk.bio.getvalue())
        super().close_chunk()
        self.bio.seek(start + _CHECKSUM_AT)
        self.bio.write(checksum.to_bytes(4, 'little'))
        self.bio.seek(0, os.SEEK_END)
        self.bio.flush()


class _ChunkedWriter(Writer):  # type: ignore[misc]
    STORAGE_PLUGINS = {**Writer.STORAGE_PLUGINS, StoragePlugin.MCAP: _ChunkWriter}  # noqa: RUF012  as in Writer


class BagWriter:
    """A rosbag2 folder that appears, complete, when the `with` block ends without an error.

    Messages are ordered by stamp, then topic, within a window of half a second, so that the order
    in which threads or executors delivered them doesn't show. Log time is the stamp.

    Args:
        path: Folder to create.
        overwrite: Replace a bag that is there.

    Attributes:
        compose: Makes the messages to `add`.

    Raises:
        RecordingError: something is at `path` that must stay, or the folder can't be made.
    """

    def __init__(self, path: str | Path, *, overwrite: bool = False) -> None:
        self._path = check_target(path, overwrite)
        self._store = typestore()
        self._canonical: dict[tuple[str, str], CanonicalMessages] = {}
        self.compose = composer()
        self._work = self._path.parent / f'.{self._path.name}.partial'
        self._queue: list[tuple[int, str, int, str, bytes, bool]] = []
        self._count = 0
        self._newest_ns = -(2**63)
        self._connections: dict[str, tuple[str, bags.Connection]] = {}

    def __enter__(self) -> BagWriter:
        """Start the recording beside its final place."""
        try:
            if self._work.exists():
                shutil.rmtree(self._work)
            self._work.mkdir(parents=True)
            self._writer = _ChunkedWriter(
                self._work / _NAME, version=_VERSION, storage_plugin=StoragePlugin.MCAP
            )
            self._writer.open()
        except (OSError, WriterError) as error:
            shutil.rmtree(self._work, ignore_errors=True)
            raise self._unwritten(error) from error
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Finish and move into place; after an error, leave nothing."""
        try:
            if kind is None:
                self._finish()
        except OSError as failure:
            raise self._unwritten(failure) from failure
        finally:
            with suppress(OSError):  # what it still holds has no place on a full disk
                self._writer.abort()  # nothing to do where it is closed
            shutil.rmtree(self._work, ignore_errors=True)

    @property
    def message_count(self) -> int:
        """Messages taken so far."""
        return self._count

    def add(self, topic: str, message: Any) -> None:
        """Write a message with a header that `compose` made; its stamp is its time."""
        ns = stamp_ns(message.header.stamp)
        self._write(topic, message.__msgtype__, ns, encoded(message), False)

    def text(self, topic: str, stamp_ns: int, text: str) -> None:
        """Write a latched String, such as `/robot_description`."""
        msgtype = 'std_msgs/msg/String'
        message = self.compose.make(msgtype, data=text)
        self._write(topic, msgtype, stamp_ns, encoded(message), True)

    def message(
        self, topic: str, msgtype: str, stamp_ns: int, cdr: bytes, latched: bool = False
    ) -> None:
        """Write a serialized message of any known type; its padding is zeroed.

        Args:
            topic: Topic.
            msgtype: Such as `spacerobot_msgs/msg/Estimate`.
            stamp_ns: Log time [ns].
            cdr: The message as the middleware serialized it.
            latched: Whether `ros2 bag play` shall latch the topic.

        Raises:
            RecordingError: unknown type, or bytes that are not such a message.
        """
        if (topic, msgtype) not in self._canonical:
            self._canonical[topic, msgtype] = CanonicalMessages(msgtype)
        try:
            clean = self._canonical[topic, msgtype](cdr)
        except MessageRejectedError as error:
            raise RecordingError(topic, str(error)) from error
        self._write(topic, msgtype, stamp_ns, clean, latched)

    def flush(self) -> None:
        """Put what came so far where a kill leaves it; what is late after that is out of order.

        Raises:
            RecordingError: it can not be written.
        """
        try:
            while self._queue:
                self._write_oldest()
            if self._writer.storage.chunk.msgs:
                self._writer.storage.close_chunk()
        except OSError as error:
            raise self._unwritten(error) from error

    def _write(self, topic: str, msgtype: str, stamp_ns: int, cdr: bytes, latched: bool) -> None:
        heapq.heappush(self._queue, (stamp_ns, topic, self._count, msgtype, cdr, latched))
        self._count += 1
        self._newest_ns = max(self._newest_ns, stamp_ns)
        try:
            while self._queue[0][0] < self._newest_ns - _REORDER_NS:
                self._write_oldest()
        except OSError as error:
            raise self._unwritten(error) from error

    def _unwritten(self, error: Exception) -> RecordingError:
        why = error.strerror if isinstance(error, OSError) else None
        return RecordingError(str(self._path), f'can not be written: {why or error}')

    def _write_oldest(self) -> None:
        stamp_ns, topic, _, msgtype, cdr, latched = heapq.heappop(self._queue)
        if topic not in self._connections:
            connection = self._writer.add_connection(
                topic, msgtype, typestore=self._store, offered_qos_profiles=[_qos(latched)]
            )
            self._connections[topic] = (msgtype, connection)
        known, connection = self._connections[topic]
        if known != msgtype:
            raise RecordingError(topic, f'carries {known} and {msgtype}')
        self._writer.write(connection, stamp_ns, cdr)

    def _finish(self) -> None:
        while self._queue:
            self._write_oldest()
        self._writer.close()
        if self._path.exists():
            check_target(self._path, overwrite=True)
            self._path.rename(self._work / 'replaced')
        (self._work / _NAME).rename(self._path)


def _qos(latched: bool) -> bags.Qos:
    return bags.Qos(
        bags.QosHistory.KEEP_LAST,
        1 if latched else 10,
        bags.QosReliability.RELIABLE,
        bags.QosDurability.TRANSIENT_LOCAL if latched else bags.QosDurability.VOLATILE,
        _FOREVER,
        _FOREVER,
        bags.QosLiveliness.AUTOMATIC,
        _FOREVER,
        False,
    )
