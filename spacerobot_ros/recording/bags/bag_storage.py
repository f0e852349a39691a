"""The files of a rosbag2 recording: which there are, their messages, and what of them is lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from rosbags.rosbag2 import Reader

from ...errors import ConfigurationError, RecordingError
from ...model.files import read_yaml
from .mcap_file import McapFile

_UNSEEN = 'has no checksums: damage to its numbers would not be noticed'


@dataclass(frozen=True, slots=True)
class StoredMessages:
    """What a recording holds of the wanted topics.

    Args:
        channels: Topic and type, of all topics.
        messages: Topic, type and bytes in the order of their log times.
        notes: What is lost.
    """

    channels: frozenset[tuple[str, str]]
    messages: list[tuple[str, str, bytes]]
    notes: list[str]


def read_messages(path: Path, wanted: Collection[str]) -> StoredMessages:
    """Read a recording as far as it is undamaged.

    Args:
        path: A rosbag2 folder, or one mcap or db3 file.
        wanted: Topics whose messages are kept.

    Raises:
        RecordingError: no recording, or nothing of it can be read.
    """
    if not path.exists():
        raise RecordingError(str(path), 'no such file or folder')
    if path.is_file():
        return _read_mcaps([path], {}, wanted) if path.suffix == '.mcap' else _read(path, wanted)
    if not path.is_dir():
        raise RecordingError(str(path), 'is neither a file nor a folder')
    there = sorted(path.glob('*.mcap'))
    if not (path / 'metadata.yaml').is_file() and not there:
        raise RecordingError(str(path), 'has no metadata.yaml, so it is no rosbag2 folder')
    information = _information(path)
    if not there or information.get('compression_mode', '').lower() not in ('', 'none', 'storage'):
        return _read(path, wanted)
    return _read_mcaps(there, information, wanted)


def _information(folder: Path) -> Mapping[str, Any]:
    """Content of metadata.yaml; empty where it can not be used."""
    try:
        content = read_yaml(folder / 'metadata.yaml', 'metadata')
        information = content['rosbag2_bagfile_information']
        for key in ('relative_file_paths', 'topics_with_message_count'):
            list(information[key])
        str(information['compression_mode']).lower()
        _limits(information), _counts(information)
    except (ConfigurationError, KeyError, TypeError, AttributeError, ValueError):
        return {}
    return dict(information)


def _counts(information: Mapping[str, Any]) -> Counter[str]:
    """Number of messages by topic that the recorder says."""
    counts: Counter[str] = Counter()
    for entry in information.get('topics_with_message_count', ()):
        counts[str(entry['topic_metadata']['name'])] += int(entry['message_count'])
    return counts


def _limits(information: Mapping[str, Any]) -> tuple[int, int] | None:
    """First and last log time that the recorder says [ns]."""
    if not information:
        return None
    first = int(information['starting_time']['nanoseconds_since_epoch'])
    return first, first + int(information['duration']['nanoseconds'])


def _read_mcaps(
    paths: list[Path], information: Mapping[str, Any], wanted: Collection[str]
) -> StoredMessages:
    listed = [PurePath(str(name)).name for name in information.get('relative_file_paths', ())]
    if missing := sorted(set(listed) - {path.name for path in paths}):
        raise RecordingError(str(paths[0].parent), f'{", ".join(missing)} is missing')
    files = [path for path in paths if not listed or path.name in listed]
    contents = [McapFile(path, wanted) for path in files]
    stated = _counts(information) or sum((c.by_topic(c.stated) for c in contents), Counter())
    read = sum((c.by_topic(c.counts) for c in contents), Counter())
    notes: list[str] = []
    for content in contents:
        notes += content.damage(_limits(information) if len(files) == 1 else None)
        if not content.has_checksums:
            notes.append(f'{content.path.name} {_UNSEEN}')
    for path in sorted(set(paths) - set(files)):
        notes.append(f'{path.name} is not in metadata.yaml: left out')
    short = [f'{read[t]} of {n} messages of {t}' for t, n in stated.items() if read[t] < n]
    if short:
        notes.append(f'damaged: read {", ".join(short)}')
    messages = sorted(
        ((log, *topics[key], data)
         for content in contents
         for topics in [content.topics]
         for log, key, data in content.messages
         if topics.get(key, ('',))[0] in wanted),
        key=lambda message: message[0],
    )  # fmt: skip
    channels = frozenset(topic for content in contents for topic in content.topics.values())
    return StoredMessages(channels, [message[1:] for message in messages], notes)


def _read(path: Path, wanted: Collection[str]) -> StoredMessages:
    """Of any storage, whole or not at all."""
    try:
        with Reader(path) as reader:
            channels = frozenset((c.topic, c.msgtype) for c in reader.connections)
            connections = [c for c in reader.connections if c.topic in wanted]
            messages = [
                (c.topic, c.msgtype, bytes(data))
                for c, _, data in (reader.messages(connections) if connections else ())
            ]
    except Exception as error:  # a damaged file makes the storage readers raise nearly anything
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise RecordingError(
            str(path), f'can not be read as a rosbag2 recording: {reason}'
        ) from error
    return StoredMessages(channels, messages, [f'{path.name} {_UNSEEN}'])
