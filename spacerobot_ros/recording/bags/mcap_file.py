"""Reading mcap files in spite of damage: every undamaged chunk, and what is lost between them.

An mcap file is a sequence of records, most of them chunks of messages with a checksum each. They
are read one after the other, so a file without its end is read as far as it is good; where a
record makes no sense, the next chunk whose checksum fits is sought. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import mmap
import re
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from zlib import crc32

from mcap.reader import FOOTER_SIZE, SeekingReader
from mcap.records import Channel, Chunk, DataEnd, Footer, McapRecord, Message, Schema
from mcap.stream_reader import MAGIC_SIZE, StreamReader, breakup_chunk

from ...errors import RecordingError

_MAGIC = b'\x89MCAP0\r\n'
_CRC_SIZE = 4
_CHUNK_HEAD = 9 + 40  # bytes of a chunk beside its content and the name of its compression
_MAY_BE_CHUNK = re.compile(rb'\x06(?=.{5}\0\0\0)', re.DOTALL)  # of less than 2^40 bytes


@dataclass(slots=True)
class McapContent:
    """What an mcap file holds of the wanted topics.

    Args:
        schemas: By id.
        channels: By id.
        messages: Log time [ns], id of the channel and bytes, in the order of the file; also those
            whose channel is unknown when they are read.
        spans: First and last log time of each chunk [ns]; None for damage between them.
        stated: Number of messages by topic, where the file says it.
        limits: First and last log time of all [ns], where the file says it.
        damaged_at: First byte of each damaged part.
        is_cut: Whether its end is missing.
        has_checksums: Whether damage to a message would be noticed.
        counts: Number of messages read by channel, wanted or not.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
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
    def topics(self) -> dict[int, tuple[str, str]]:
        """Topic and type of the messages of each channel."""
        types = {key: schema.name for key, schema in self.schemas.items()}
        return {k: (c.topic, types.get(c.schema_id, '')) for k, c in self.channels.items()}

    @property
    def read(self) -> Counter[str]:
        """Number of messages read by topic, wanted or not."""
        return self.by_topic(self.counts)

    def by_topic(self, counts: dict[int, int]) -> Counter[str]:
        """Numbers of messages by topic from those by channel."""
        total: Counter[str] = Counter()
        for key, count in counts.items():
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
        self._has_data_checksum = False
        self.content = McapContent(is_cut=data[-MAGIC_SIZE:] != _MAGIC)
        self.is_spoilt = False

    def run(self) -> None:
        """Read it, from chunk to chunk where there is damage."""
        with suppress(Exception):  # then the chunks say what is in them
            self._summary()
        position: int | None = MAGIC_SIZE
        while position is not None:
            position = self._to_damage(position)
        if not any(self.content.spans):  # chunks have their own
            self.content.has_checksums &= self._has_data_checksum

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
        data, content = self._data, self.content
        footer: McapRecord = next(self._records(len(data) - FOOTER_SIZE - MAGIC_SIZE))
        stated = data[footer.summary_start : len(data) - MAGIC_SIZE - _CRC_SIZE]
        if footer.summary_crc not in (0, crc32(stated)):
            return
        data.seek(0)
        summary = SeekingReader(data, record_size_limit=len(data)).get_summary()
        content.schemas, content.channels = dict(summary.schemas), dict(summary.channels)
        if summary.statistics is not None:
            all_of_it = summary.statistics
            content.limits = all_of_it.message_start_time, all_of_it.message_end_time
            content.stated = content.by_topic(all_of_it.channel_message_counts)

    def _to_damage(self, start: int) -> int | None:
        """Read records until one is damaged; where the next good chunk is."""
        content, good, position = self.content, start, start
        with suppress(Exception):  # of the decoder, which may raise anything
            for record in self._records(start):
                end = self._data.tell()
                if isinstance(record, Chunk):
                    for inner in _opened(record, end - position):
                        self._take(inner)
                    content.has_checksums &= record.uncompressed_crc != 0
                    content.spans.append((record.message_start_time, record.message_end_time))
                    good = end
                elif isinstance(record, DataEnd | Footer):
                    self._end(record, position)
                    return None
                else:
                    self._take(record)
                position = end
        content.damaged_at.append(position)
        content.spans.append(None)
        return self._next_chunk(good if good > start else start + 1)

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
        content = self.content
        if isinstance(record, Message):
            content.counts[record.channel_id] += 1
            channel = content.channels.get(record.channel_id)
            if channel is None or channel.topic in self._wanted:
                content.messages.append((record.log_time, record.channel_id, record.data))
        elif isinstance(record, Channel):
            content.channels[record.id] = record
        elif isinstance(record, Schema):
            content.schemas[record.id] = record

    def _end(self, record: DataEnd | Footer, position: int) -> None:
        """Compare the checksum of everything before it, where there is one."""
        checksum = getattr(record, 'data_section_crc', 0)
        self._has_data_checksum = checksum != 0
        if checksum and not any(self.content.spans):
            self.is_spoilt = crc32(memoryview(self._data)[:position]) != checksum


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
