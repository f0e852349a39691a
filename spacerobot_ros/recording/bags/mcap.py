"""Reading mcap files in spite of damage: every undamaged chunk, and what is lost beside them.

An mcap file is a sequence of records: an opcode, a length of 64 bits, the content. Messages stand
in chunks with a checksum each; an index may follow. Here the records are read one after the
other, so a file without its end is read as far as it is good; where a record makes no sense, the
next chunk whose checksum fits is sought. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import mmap
import re
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from rosbags.rosbag2.storage_mcap import decompress

from ...errors import RecordingError

_MAGIC = b'\x89MCAP0\r\n'
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6
_STATISTICS, _DATA_END = 0x0B, 0x0F
_FOOTER_SIZE = 9 + 20 + len(_MAGIC)
_LONGEST_HEAD = 64  # of a chunk: sizes, checksum and the name of its compression
_MAY_BE_CHUNK = re.compile(rb'\x06(?=.{5}\0\0\0)', re.DOTALL)  # of less than 2^40 bytes


class _DamagedError(Exception):
    """Bytes that are no record."""


_NO_RECORD = (_DamagedError, ValueError, struct.error)


class Channel(NamedTuple):
    """What the messages of a channel are."""

    topic: str
    msgtype: str


@dataclass(slots=True)
class McapContent:
    """What an mcap file holds of the wanted topics.

    Args:
        channels: By id.
        messages: Log time [ns], id of the channel and bytes, in the order of the file.
        spans: First and last log time of each chunk [ns]; None for damage between them.
        stated: Number of messages by topic, where the file says it.
        limits: First and last log time of all [ns], where the file says it.
        damaged_at: First byte of each damaged part.
        is_cut: Whether its end is missing.
        has_checksums: Whether damage to a message would be noticed.
        counts: Number of messages read by channel, wanted or not.
    """

    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[tuple[int, int, bytes]] = field(default_factory=list)
    spans: list[tuple[int, int] | None] = field(default_factory=list)
    stated: dict[str, int] = field(default_factory=dict)
    limits: tuple[int, int] | None = None
    damaged_at: list[int] = field(default_factory=list)
    is_cut: bool = False
    has_checksums: bool = True
    counts: Counter[int] = field(default_factory=Counter)

    @property
    def read(self) -> Counter[str]:
        """Number of messages read by topic, wanted or not."""
        total: Counter[str] = Counter()
        for key, count in self.counts.items():
            if key in self.channels:
                total[self.channels[key].topic] += count
        return total

    def lost_ns(self, limits: tuple[int, int] | None) -> int | None:
        """Time that no good chunk covers where there is damage [ns]; None where nobody knows.

        Args:
            limits: First and last log time [ns], where it is known.
        """
        head = [(limits[0], limits[0])] if limits else []
        tail = [(limits[1], limits[1])] if limits else []
        lost = 0
        for i, span in enumerate(self.spans):
            if span is None:
                before = [*head, *filter(None, self.spans[:i])]
                after = [*filter(None, self.spans[i + 1 :]), *tail]
                if not before or not after:
                    return None
                lost += max(0, after[0][0] - before[-1][1])
        return lost


def read_mcap(path: Path, wanted: Collection[str]) -> McapContent:
    """Read all that is undamaged.

    Args:
        path: The file.
        wanted: Topics whose messages are kept.

    Raises:
        RecordingError: not readable, or nothing in it is good.
    """
    try:
        with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            scan = _Scan(data, wanted)
            scan.run()
    except OSError as error:
        why = f'can not be read: {error.strerror or error}'
        raise RecordingError(str(path), why) from error
    except ValueError as error:  # nothing to map
        raise RecordingError(str(path), 'can not be read as a rosbag2 recording: empty') from error
    content = scan.content
    if content.damaged_at and not content.counts:
        where = f'damaged from byte {content.damaged_at[0]}, and no chunk in it is good'
        raise RecordingError(str(path), f'can not be read as a rosbag2 recording: {where}')
    if scan.is_spoilt and not any(content.spans):
        why = 'its checksum does not fit, and without chunks nothing says where it is damaged'
        raise RecordingError(str(path), why)
    return content


class _Scan:
    """One pass through the records of a file."""

    def __init__(self, data: mmap.mmap, wanted: Collection[str]) -> None:
        self._data, self._wanted = data, wanted
        self._schemas: dict[int, str] = {}
        self.content = McapContent()
        self.is_spoilt = False

    def run(self) -> None:
        """Read it, from chunk to chunk where there is damage."""
        self._summary()
        self.content.is_cut = self._data[-len(_MAGIC) :] != _MAGIC
        position: int | None = len(_MAGIC)
        while position is not None:
            position = self._to_damage(position)
        if not any(self.content.spans):  # chunks have their own
            self.content.has_checksums &= self._has_checksum

    _has_checksum = False

    def _summary(self) -> None:
        """Channels and counts at the end of the file, where it has them."""
        data, content = self._data, self.content
        footer = len(data) - _FOOTER_SIZE
        if footer < len(_MAGIC) or data[-len(_MAGIC) :] != _MAGIC:
            return
        start, _, checksum = struct.unpack_from('<QQI', data, footer + 9)
        if not len(_MAGIC) <= start <= footer:
            return
        if checksum and crc32(data[start : footer + 9 + 16]) != checksum:
            return
        counts: dict[int, int] = {}
        try:
            for op, body in _records(data, start, footer):
                if op == _STATISTICS:
                    content.limits = struct.unpack_from('<QQ', body, 26)
                    counts = dict(struct.iter_unpack('<HQ', body[46:]))
                else:
                    self._definition(op, body)
        except _NO_RECORD:
            content.limits = None
            return
        content.stated = {
            channel.topic: counts[key]
            for key, channel in content.channels.items()
            if key in counts
        }

    def _to_damage(self, start: int) -> int | None:
        """Read records until one is damaged; where the next good chunk is."""
        data, good, position = self._data, start, start
        try:
            for op, body in _records(data, start, len(data)):
                if op == _CHUNK:
                    self._chunk(body)
                    good = position + 9 + len(body)
                elif op == _DATA_END:
                    self._data_end(body, position)
                elif op == _FOOTER:
                    return None
                else:
                    self._definition(op, body)
                    if op == _MESSAGE:
                        self._message(body)
                position += 9 + len(body)
        except _NO_RECORD:
            pass
        self.content.damaged_at.append(position)
        self.content.spans.append(None)
        return self._next_chunk(good if good > start else start + 1)

    def _next_chunk(self, after: int) -> int | None:
        """Where the next chunk begins that is good."""
        data = self._data
        for found in _MAY_BE_CHUNK.finditer(data, after):
            start = found.start() + 9
            (size,) = struct.unpack_from('<Q', data, start - 8)
            try:
                if start + size <= len(data):
                    _packed_from(data[start : start + _LONGEST_HEAD], size)  # before it is copied
                    _opened(data[start : start + size])
                    return found.start()
            except _NO_RECORD:
                continue
        return None

    def _chunk(self, body: bytes) -> None:
        first, last, checksum = struct.unpack_from('<QQ8xI', body)
        for op, inner in _opened(body):
            self._definition(op, inner)
            if op == _MESSAGE:
                self._message(inner)
        self.content.has_checksums &= checksum != 0
        self.content.spans.append((first, last))

    def _message(self, body: bytes) -> None:
        key, _, log_ns = struct.unpack_from('<HIQ', body)
        self.content.counts[key] += 1
        channel = self.content.channels.get(key)
        if channel is None or channel.topic in self._wanted:
            self.content.messages.append((log_ns, key, body[22:]))

    def _definition(self, op: int, body: bytes) -> None:
        """Take note of a schema or a channel."""
        if op == _SCHEMA:
            name, _ = _text(body, 2)
            self._schemas[struct.unpack_from('<H', body)[0]] = name
        elif op == _CHANNEL:
            key, schema = struct.unpack_from('<HH', body)
            topic, end = _text(body, 4)
            _, end = _text(body, end)
            if end + 4 + struct.unpack_from('<I', body, end)[0] != len(body):
                raise _DamagedError
            self.content.channels[key] = Channel(topic, self._schemas.get(schema, ''))

    def _data_end(self, body: bytes, position: int) -> None:
        """Compare the checksum of everything before it, where there is one."""
        (checksum,) = struct.unpack('<I', body)
        self._has_checksum = checksum != 0
        if checksum and not any(self.content.spans):
            self.is_spoilt = crc32(memoryview(self._data)[:position]) != checksum


def _records(data: mmap.mmap | bytes, start: int, end: int) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each record; raises _DamagedError where one is not whole."""
    while start < end:
        if end - start < 9:
            raise _DamagedError
        op, size = struct.unpack_from('<BQ', data, start)
        if op == 0 or size > end - start - 9:
            raise _DamagedError
        yield op, data[start + 9 : start + 9 + size]
        start += 9 + size
        if op == _FOOTER:
            return


def _text(body: bytes, start: int) -> tuple[str, int]:
    (size,) = struct.unpack_from('<I', body, start)
    end = start + 4 + size
    if end > len(body):
        raise _DamagedError
    return body[start + 4 : end].decode(), end


def _packed_from(body: bytes, size: int) -> int:
    """Where the packed records of a chunk begin; raises _DamagedError where its sizes disagree.

    Args:
        body: Its content, or the beginning.
        size: Of the content.
    """
    _, start = _text(body, 28)
    (packed,) = struct.unpack_from('<Q', body, start)
    if start + 8 + packed != size:
        raise _DamagedError
    return start + 8


def _opened(body: bytes) -> list[tuple[int, bytes]]:
    """The records of a chunk whose checksum fits."""
    size, checksum = struct.unpack_from('<QI', body, 16)
    start, (compression, _) = _packed_from(body, len(body)), _text(body, 28)
    try:
        content = decompress(body[start:], compression, size, checksum)
    except Exception as error:
        raise _DamagedError from error  # the libraries raise nearly anything
    return list(_records(content, 0, len(content)))
