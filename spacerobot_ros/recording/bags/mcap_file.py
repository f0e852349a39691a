"""Reading mcap files in spite of damage: every undamaged chunk, and what is lost between them.

An mcap file is a sequence of records, most of them chunks of messages with a checksum each. They
are read one after the other, so a file without its end is read as far as it is good; where a
record makes no sense, the next chunk whose checksum fits is sought. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from zlib import crc32

from mcap.reader import FOOTER_SIZE, SeekingReader
from mcap.records import Channel, Chunk, DataEnd, Footer, McapRecord, Message, Schema
from mcap.stream_reader import MAGIC_SIZE, StreamReader, breakup_chunk

from ...errors import RecordingError
from ..record import shown

_MAGIC = b'\x89MCAP0\r\n'
_CRC_SIZE = 4
_CHUNK_HEAD = 9 + 40  # bytes of a chunk beside its content and the name of its compression
_MAY_BE_CHUNK = re.compile(rb'\x06(?=.{5}\0\0\0)', re.DOTALL)  # of less than 2^40 bytes


class McapFile:
    """What an mcap file holds of the wanted topics, as far as it is undamaged.

    Args:
        path: The file.
        wanted: Topics whose messages are kept.

    Attributes:
        messages: Log time [ns], id of the channel and bytes, in the order of the file; also those
            whose channel is unknown when they are read.
        counts: Number of messages read by channel, wanted or not.
        stated: The same as the file says it; empty where it does not.
        has_checksums: Whether damage to a message would be noticed.

    Raises:
        RecordingError: not readable, or nothing in it is good.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self.path, self._wanted = path, wanted
        self.messages: list[tuple[int, int, bytes]] = []
        self.counts: Counter[int] = Counter()
        self.stated: dict[int, int] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._limits: tuple[int, int] | None = None  # first and last log time [ns]
        self._spans: list[tuple[int, int] | None] = []  # of chunks [ns]; None for damage between
        self._damaged_at: int | None = None
        self.has_checksums, self._has_chunks, self._is_spoilt = True, False, False
        self._open()

    def _open(self) -> None:
        """Read the file; refuse one of which nothing is good."""
        path = self.path
        try:
            with path.open('rb') as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                self._data = data
                self._read()
        except OSError as error:
            why = f'can not be read: {error.strerror or error}'
            raise RecordingError(str(path), why) from error
        except ValueError as error:  # nothing to map
            why = 'can not be read as a rosbag2 recording: empty'
            raise RecordingError(str(path), why) from error
        if self._damaged_at is not None and not self.counts:
            where = f'damaged from byte {self._damaged_at}, and no chunk in it is good'
            raise RecordingError(str(path), f'can not be read as a rosbag2 recording: {where}')
        if self._is_spoilt and not self._has_chunks:
            why = 'its checksum does not fit, and without chunks nothing says where it is damaged'
            raise RecordingError(str(path), why)

    @property
    def topics(self) -> dict[int, tuple[str, str]]:
        """Topic and type of the messages of each channel."""
        types = {key: schema.name for key, schema in self._schemas.items()}
        return {k: (c.topic, types.get(c.schema_id, '')) for k, c in self._channels.items()}

    def by_topic(self, counts: Mapping[int, int]) -> Counter[str]:
        """Numbers of messages by topic from those by channel."""
        total: Counter[str] = Counter()
        for key, count in counts.items():
            if key in self._channels:
                total[self._channels[key].topic] += count
        return total

    def damage(self, limits: tuple[int, int] | None) -> list[str]:
        """What is lost, in one line; nothing of an undamaged file.

        Args:
            limits: First and last log time [ns], as another source knows them.
        """
        if self._damaged_at is None:
            return []
        what = 'is cut short' if self._is_cut else 'is damaged'
        lost = self._lost_ns(self._limits or limits)
        size = 'nobody knows how much' if lost is None else shown(lost / 1e9)
        return [f'{self.path.name} {what} at byte {self._damaged_at}: {size} is lost there']

    def _lost_ns(self, limits: tuple[int, int] | None) -> int | None:
        """Time that no good chunk covers where there is damage [ns]; None where nobody knows."""
        ends = [(limit, limit) for limit in limits] if limits else [None, None]
        spans = [ends[0], *self._spans, ends[1]]
        lost = 0
        for i in range(1, len(spans) - 1):
            if spans[i] is None:
                before, after = ([*filter(None, part)] for part in (spans[:i], spans[i + 1 :]))
                if not before or not after:
                    return None
                lost += max(0, after[0][0] - before[-1][1])
        return lost

    def _read(self) -> None:
        """Read it, from chunk to chunk where there is damage."""
        self._is_cut = self._data[-MAGIC_SIZE:] != _MAGIC
        self._has_data_checksum = False
        with suppress(Exception):  # then the chunks say what is in them
            self._summary()
        position: int | None = MAGIC_SIZE
        while position is not None:
            position = self._to_damage(position)
        self._has_chunks = any(self._spans)
        self.has_checksums &= self._has_chunks or self._has_data_checksum

    def _records(self, start: int) -> Iterator[McapRecord]:
        """The records from a byte on; any exception where one is not whole."""
        self._data.seek(start)
        most = len(self._data) - start
        reader = StreamReader(
            self._data, skip_magic=True, emit_chunks=True, record_size_limit=most
        )
        return iter(reader.records)

    def _summary(self) -> None:
        """Channels and counts at the end of the file, where it has them and they are undamaged."""
        footer: McapRecord = next(self._records(len(self._data) - FOOTER_SIZE - MAGIC_SIZE))
        told = self._data[footer.summary_start : len(self._data) - MAGIC_SIZE - _CRC_SIZE]
        if footer.summary_crc not in (0, crc32(told)):
            return
        self._data.seek(0)
        summary = SeekingReader(self._data, record_size_limit=len(self._data)).get_summary()
        self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
        if (all_of_it := summary.statistics) is not None:
            self._limits = all_of_it.message_start_time, all_of_it.message_end_time
            self.stated = all_of_it.channel_message_counts

    def _to_damage(self, start: int) -> int | None:
        """Read records until one is damaged; where the next good chunk is."""
        good, position = start + 1, start
        with suppress(Exception):  # of the decoder, which may raise anything
            for record in self._records(start):
                end = self._data.tell()
                if isinstance(record, Chunk):
                    for inner in _opened(record, end - position):
                        self._take(inner)
                    self.has_checksums &= record.uncompressed_crc != 0
                    self._spans.append((record.message_start_time, record.message_end_time))
                    good = end
                elif isinstance(record, DataEnd | Footer):
                    checksum = getattr(record, 'data_section_crc', 0)
                    self._has_data_checksum = checksum != 0
                    if checksum and not any(self._spans):
                        self._is_spoilt = crc32(memoryview(self._data)[:position]) != checksum
                    return None
                else:
                    self._take(record)
                position = end
        if self._damaged_at is None:
            self._damaged_at = position
        self._spans.append(None)
        return self._next_chunk(good)

    def _next_chunk(self, after: int) -> int | None:
        """Where the next chunk begins that is good."""
        for found in _MAY_BE_CHUNK.finditer(self._data, after):
            with suppress(Exception):
                record = next(self._records(found.start()))
                _opened(record, self._data.tell() - found.start())
                return found.start()
        return None

    def _take(self, record: McapRecord) -> None:
        """Keep a message that is wanted, and what a schema or a channel says."""
        if isinstance(record, Message):
            self.counts[record.channel_id] += 1
            channel = self._channels.get(record.channel_id)
            if channel is None or channel.topic in self._wanted:
                self.messages.append((record.log_time, record.channel_id, record.data))
        elif isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Schema):
            self._schemas[record.id] = record


def _opened(chunk: Chunk, size: int) -> list[McapRecord]:
    """The records of a chunk whose checksum fits.

    Args:
        chunk: The chunk.
        size: Bytes that it takes in the file.

    Raises:
        Exception: anything, where it is damaged.
    """
    if size != _CHUNK_HEAD + len(chunk.compression) + len(chunk.data):
        raise ValueError('its sizes disagree')
    if not chunk.compression and chunk.uncompressed_size != len(chunk.data):
        raise ValueError('its sizes disagree')
    return breakup_chunk(chunk, validate_crc=True)
