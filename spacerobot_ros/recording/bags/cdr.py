"""Serialized messages of which most have their numbers at the same places as the one before.

Common Data Representation (OMG DDS-XTypes 1.3, section 7.4.1): a number begins at a multiple of
its size, and what stands in the gaps before it is whatever was in memory there.
"""

from __future__ import annotations

from collections.abc import Iterator
from operator import itemgetter
from struct import Struct, unpack_from
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

PLAIN = b'\x00\x01\x00\x00'  # plain, little-endian
_LENGTH = 4  # bytes that say the length of a text or sequence
_SIZES = {
    **dict.fromkeys(('bool', 'byte', 'char', 'int8', 'uint8'), 1),
    **dict.fromkeys(('int16', 'uint16'), 2),
    **dict.fromkeys(('int32', 'uint32', 'float32'), 4),
    **dict.fromkeys(('int64', 'uint64', 'float64'), 8),
}


class Layout:
    """Where the numbers of messages with the same texts and lengths are.

    Args:
        store: Knows the type.
        msgtype: Such as `sensor_msgs/msg/Imu`.
        cdr: A valid message.

    Raises:
        KeyError: a type, or a kind of number, that is not known.
        ValueError: not the representation that ROS 2 writes.
    """

    def __init__(self, store: Typestore, msgtype: str, cdr: bytes) -> None:
        if cdr[: len(PLAIN)] != PLAIN:
            raise ValueError('not little-endian')
        self._store, self._cdr, self._at = store, cdr, len(PLAIN)
        parts = [(f'{self._at}s', True), *self._message(msgtype)]
        used, end = ''.join(part for part, _ in parts), len(cdr) - self._at
        self._read, self._written = Struct(f'<{used}{end}x'), Struct(f'<{used}')
        values = self._read.unpack(cdr)
        fixed = [k for k, (_, is_fixed) in enumerate(parts) if is_fixed]
        self._pick = itemgetter(*fixed, 0)
        self._expected = self._pick(values)

    def canonical(self, cdr: bytes) -> bytes | None:
        """A message with zeros in its gaps; None where its layout is another one."""
        if len(cdr) != self._read.size:
            return None
        values = self._read.unpack(cdr)
        return self._written.pack(*values) if self._pick(values) == self._expected else None

    def _message(self, msgtype: str) -> Iterator[tuple[str, bool]]:
        """Format of each part of a message, and whether it is what makes the layout."""
        for _, field in self._store.fielddefs[msgtype][1]:
            yield from self._field(*field)

    def _field(self, node: Nodetype, detail: Any) -> Iterator[tuple[str, bool]]:
        if node is Nodetype.NAME:
            yield from self._message(detail)
        elif node is Nodetype.BASE and detail[0] == 'string':
            yield self._numbers(1, _LENGTH), True
            yield self._numbers(self._length(), 1), True
        elif node is Nodetype.BASE:
            yield self._numbers(1, _SIZES[detail[0]]), False
        else:
            (kind, what), count = detail
            if node is Nodetype.SEQUENCE:
                yield self._numbers(1, _LENGTH), True
                count = self._length()
            if kind is Nodetype.BASE and what[0] != 'string' and count:
                yield self._numbers(count, _SIZES[what[0]]), False
            elif kind is not Nodetype.BASE or what[0] == 'string':
                for _ in range(count):
                    yield from self._field(kind, what)

    def _numbers(self, count: int, size: int) -> str:
        gap = (len(PLAIN) - self._at) % size
        self._at += gap + count * size
        return f'{gap}x{count * size}s'

    def _length(self) -> int:
        return int(unpack_from('<I', self._cdr, self._at - _LENGTH)[0])
