"""Writing rosbag2 folders (mcap), which any ROS 2 tool reads."""

from __future__ import annotations

import heapq
import math
import shutil
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags import interfaces as bags
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import TypesysError

from ...errors import RecordingError
from ...model.files import written_whole
from ..messages import stamp_ns
from .message_types import composer, encoded, typestore

_VERSION = 9  # of the bag's metadata: Jazzy and later
_REORDER_NS = 500_000_000
_CHUNK_NS = 500_000_000  # the most that damage to a chunk costs; a killed process the order, too
_NAME = 'recording.mcap'
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


class _Storage:
    """An mcap file with checksums, as rosbags' `Writer` asks for one.

    Chunks have half a second at most, and are on the disk as soon as they are full.
    """

    def __init__(self, folder: Path, _: object) -> None:
        self.path = folder / _NAME
        self._file = self.path.open('xb')
        self._mcap = McapWriter(self._file, compression=CompressionType.NONE)
        self._mcap.start('ros2')
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}
        self._begun_ns: int | None = None

    def add_msgtype(self, connection: bags.Connection) -> None:
        """Add a message type."""
        text = connection.msgdef.data.encode()
        schema = self._mcap.register_schema(connection.msgtype, 'ros2msg', text)
        self._schemas[connection.msgtype] = schema

    def add_connection(self, connection: bags.Connection, qos: str) -> None:
        """Add a topic."""
        self._channels[connection.id] = self._mcap.register_channel(
            connection.topic,
            connection.ext.serialization_format,
            self._schemas[connection.msgtype],
            {'offered_qos_profiles': qos},
        )

    def write(self, connection: bags.Connection, ns: int, data: bytes | memoryview) -> None:
        """Write a message, after the half second before it."""
        if self._begun_ns is None:
            self._begun_ns = ns
        elif ns - self._begun_ns >= _CHUNK_NS:
            self.flush()
            self._begun_ns = ns
        self._mcap.add_message(self._channels[connection.id], ns, data, ns)

    def flush(self) -> None:
        """Put what came so far on the disk."""
        self._mcap.flush()
        self._begun_ns = None

    def close(self, version: int, metadata: str) -> None:
        """Write the index, and the bag's metadata."""
        self._mcap.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._mcap.finish()
        self._file.close()

    def abort(self) -> None:
        """Close the file as it is; what it still holds has no place on a full disk."""
        with suppress(OSError):
            self._file.close()


class _Writer(Writer):  # type: ignore[misc]  # rosbags is untyped
    STORAGE_PLUGINS = {**Writer.STORAGE_PLUGINS, StoragePlugin.MCAP: _Storage}  # noqa: RUF012  as in Writer


class BagWriter:
    """A rosbag2 folder that appears, complete, when the `with` block ends without an error.

    Messages are ordered by stamp, then topic, within a window of half a second, so that the order
    in which threads or executors delivered them doesn't show. Log time is the stamp.

    Args:
        path: Folder to create.
        overwrite: Replace a bag that is there.

    Attributes:
        compose: Makes the messages to `add`.
        message_count: Messages taken so far.

    Raises:
        RecordingError: something is at `path` that must stay, or the folder can't be made.
    """

    def __init__(self, path: str | Path, *, overwrite: bool = False) -> None:
        self._path = check_target(path, overwrite)
        self.compose = composer()
        self._queue: list[tuple[int, str, int, str, bytes, bool]] = []
        self.message_count = 0
        self._newest_ns = -(2**63)
        self._connections: dict[str, bags.Connection] = {}

    def __enter__(self) -> BagWriter:
        """Start the recording beside its final place."""
        with ExitStack() as stack:
            work = stack.enter_context(written_whole(self._path, RecordingError))
            self._writer = _Writer(work, version=_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
            stack.callback(self._writer.abort)  # nothing to do where it is closed
            stack.push(self._finish)
            self._exit = stack.pop_all().__exit__
        return self

    def __exit__(self, *error: Any) -> None:
        """Finish and move into place; after an error, leave nothing."""
        self._exit(*error)

    def add(self, topic: str, message: Any) -> None:
        """Write a message with a header that `compose` made; its stamp is its time."""
        self.message(topic, message.__msgtype__, stamp_ns(message.header.stamp), encoded(message))

    def text(self, topic: str, stamp_ns: int, text: str) -> None:
        """Write a latched String, such as `/robot_description`."""
        msgtype = 'std_msgs/msg/String'
        message = self.compose.make(msgtype, data=text)
        self.message(topic, msgtype, stamp_ns, encoded(message), latched=True)

    def message(
        self, topic: str, msgtype: str, stamp_ns: int, cdr: bytes, latched: bool = False
    ) -> None:
        """Write a serialized message of any known type.

        Args:
            topic: Topic.
            msgtype: Such as `spacerobot_msgs/msg/Estimate`.
            stamp_ns: Log time [ns].
            cdr: The message as the middleware serialized it.
            latched: Whether `ros2 bag play` shall latch the topic.

        Raises:
            RecordingError: unknown type, or it can not be written.
        """
        heapq.heappush(self._queue, (stamp_ns, topic, self.message_count, msgtype, cdr, latched))
        self.message_count += 1
        self._newest_ns = max(self._newest_ns, stamp_ns)
        self._write_before(self._newest_ns - _REORDER_NS)

    def flush(self) -> None:
        """Put what came so far where a kill leaves it; what is late after that is out of order.

        Raises:
            RecordingError: it can not be written.
        """
        self._write_before(math.inf)

    def _write_before(self, limit_ns: float) -> None:
        """Write what is older; all of it, and to the disk itself, if that is infinite."""
        try:
            while self._queue and self._queue[0][0] < limit_ns:
                self._write_oldest()
            if limit_ns == math.inf:
                self._writer.storage.flush()
        except OSError as error:
            why = f'can not be written: {error.strerror or error}'
            raise RecordingError(str(self._path), why) from error

    def _write_oldest(self) -> None:
        stamp_ns, topic, _, msgtype, cdr, latched = heapq.heappop(self._queue)
        if topic not in self._connections:
            try:
                self._connections[topic] = self._writer.add_connection(
                    topic, msgtype, typestore=typestore(), offered_qos_profiles=[_qos(latched)]
                )
            except TypesysError as error:
                raise RecordingError(topic, f'not a {msgtype}: {error}') from error
        connection = self._connections[topic]
        if connection.msgtype != msgtype:
            raise RecordingError(topic, f'carries {connection.msgtype} and {msgtype}')
        self._writer.write(connection, stamp_ns, cdr)

    def _finish(self, kind: type[BaseException] | None, *_: object) -> None:
        """Complete the recording, and make room for it; nothing after an error."""
        if kind is None:
            self.flush()
            self._writer.close()
            if self._path.exists():
                shutil.rmtree(check_target(self._path, overwrite=True))


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
