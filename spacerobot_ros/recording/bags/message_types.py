"""Message types without ROS: the standard ones, and `spacerobot_msgs` from its text."""

from __future__ import annotations

import functools
import os
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ...errors import MessageRejectedError, RecordingError
from .compose import PACKAGE, Composer

_HEAD = 4  # bytes before a message that say how it is serialized
_WORD = 4  # bytes; messages are filled up to a multiple
_GUESSED = 8
"""Bytes that rclpy's `serialize_message` may add to a message for each empty sequence of numbers,
because Fast DDS' guess of its length aligns numbers that are not there."""


@functools.cache
def typestore(with_package: bool = True) -> Typestore:
    """All known message types.

    Args:
        with_package: Also `spacerobot_msgs`, whose text must then be found.

    Raises:
        RecordingError: the `.msg` files are not found or can't be parsed.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    if with_package:
        for path in sorted(message_folder().glob('*.msg')):
            _register(store, path)
    return store


def _register(store: Typestore, path: Path) -> None:
    try:
        text = path.read_text(encoding='utf-8')
        store.register(get_types_from_msg(text, f'{PACKAGE}/msg/{path.stem}'))
    except (OSError, UnicodeDecodeError, TypesysError) as error:
        reason = ' '.join(str(error).split())
        raise RecordingError(str(path), f'can not be used: {reason}') from error


def message_folder() -> Path:
    """Folder of the `.msg` files: of the built package, else those that come with this one.

    Raises:
        RecordingError: neither is there.
    """
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    built = [Path(prefix) / 'share' / PACKAGE / 'msg' for prefix in prefixes]
    for folder in (*built, Path(__file__).with_name('msg')):
        if folder.is_dir():
            return folder
    raise RecordingError(
        PACKAGE, 'is not on AMENT_PREFIX_PATH, and no messages come with this package'
    )


@functools.cache
def composer() -> Composer:
    """Makes messages of `typestore()`, to be `encoded`."""
    doubles = functools.partial(np.asarray, dtype=np.float64)
    return Composer(typestore().types.__getitem__, doubles)


def decoded(msgtype: str, cdr: bytes, *, with_package: bool = True) -> Any:
    """A message from its serialized form.

    Args:
        msgtype: Such as `sensor_msgs/msg/JointState`.
        cdr: As a middleware serialized it: plain CDR of either endianness.
        with_package: As of `typestore`.

    Raises:
        MessageRejectedError: bytes that are no such message.
    """
    try:
        if cdr[:2] not in (b'\0\0', b'\0\1'):
            raise ValueError(f'encapsulation {cdr[:2].hex()} is not plain CDR')
        store = typestore(with_package)
        kind = store.get_msgdef(msgtype)
        read = kind.deserialize_cdr_le if cdr[1] else kind.deserialize_cdr_be
        message, end = read(cdr[_HEAD:], 0, kind.cls, store)
        tail = len(cdr) - _HEAD - end
        if tail >= _WORD and tail >= _WORD + _GUESSED * _empty_vectors(message):
            raise ValueError(f'{tail} bytes too long')
    except Exception as error:  # the generated decoder may raise anything
        raise MessageRejectedError(f'not a {msgtype}: {error}') from error
    return message


def _empty_vectors(value: Any) -> int:
    """Number of sequences of numbers without any in a message."""
    if isinstance(value, np.ndarray):
        return int(not value.size)
    if isinstance(value, list):
        return sum(_empty_vectors(item) for item in value)
    if not is_dataclass(value):
        return 0
    return sum(_empty_vectors(getattr(value, field.name)) for field in fields(value))


def encoded(message: Any) -> bytes:
    """The serialized form of a message of `typestore()`."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))
