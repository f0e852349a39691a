"""Message types for reading and writing bags without ROS: the standard ones and `spacerobot_msgs` from its text."""

from __future__ import annotations

import functools
import os
from pathlib import Path

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ..errors import RecordingError

PACKAGE = 'spacerobot_msgs'


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
        folder = message_folder()
        for path in sorted(folder.glob('*.msg')):
            try:
                types = get_types_from_msg(path.read_text(encoding='utf-8'), f'{PACKAGE}/msg/{path.stem}')
                store.register(types)
            except (OSError, UnicodeDecodeError, TypesysError) as error:
                raise RecordingError(str(path), f'can not be used: {" ".join(str(error).split())}') from error
    return store


def message_folder() -> Path:
    """Folder of the `.msg` files: of the built package, else of the source checkout.

    Raises:
        RecordingError: neither is there.
    """
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    installed = [Path(prefix) / 'share' / PACKAGE / 'msg' for prefix in prefixes]
    checkout = Path(__file__).resolve().parents[2] / 'msg_defs' / 'msg'
    for folder in (*installed, checkout):
        if folder.is_dir():
            return folder
    raise RecordingError(PACKAGE, 'is neither on AMENT_PREFIX_PATH nor in a source checkout')


def canonical_cdr(msgtype: str, cdr: bytes) -> bytes:
    """The same message with its padding zeroed: middlewares leave whatever was in memory there.

    Args:
        msgtype: Such as `sensor_msgs/msg/JointState`.
        cdr: Serialised message.
    """
    store = typestore()
    return bytes(store.serialize_cdr(store.deserialize_cdr(cdr, msgtype), msgtype))
