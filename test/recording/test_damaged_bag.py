"""Damaged bags: nothing wrong enters a record, what is good is read, what is lost is said."""

from __future__ import annotations

import contextlib
import os
import re
import resource
import shutil

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from support.models import robot_of, table_one

from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.bags.bag import read_bag
from spacerobot_ros.recording.bags.bag_writer import BagWriter

ROBOT = robot_of(table_one())
STEP_NS, STEPS = 5 * 10**6, 500  # five chunks of half a second


def fill(bag, rng, steps=STEPS):
    for k in range(steps):
        ns, make = k * STEP_NS, bag.compose
        bag.add(
            '/joint_states', make.joint_state(ns, list(ROBOT.joints), *rng.normal(size=(3, 3)))
        )
        bag.add('/imu/data', make.imu(ns, 'base_link', rng.normal(size=3), 2e-5))


@pytest.fixture
def bag(tmp_path, rng):
    """Return a good bag: its folder, its mcap file, that file's bytes and its record."""
    folder = tmp_path / 'bag'
    with BagWriter(folder) as writer:
        fill(writer, rng)
    path = next(folder.glob('*.mcap'))
    return folder, path, path.read_bytes(), read_bag(folder, ROBOT)


def is_said(record, what):
    return any(re.search(what, note) for note in record.notes)


def chunks(data):
    """First and last byte of each chunk, from a walk by the format's description."""
    position, found = 8, []
    while position < len(data) - 8:
        size = 9 + int.from_bytes(data[position + 1 : position + 9], 'little')
        if data[position] == 6:
            found.append((position, position + size))
        position += size
    return found


def assert_part_of(record, whole):
    """Every sample is one of the undamaged bag's, to the last bit; how many are missing."""
    missing = 0
    for part, all_of_it, names in (
        (record.joints, whole.joints, ('position', 'velocity', 'effort')),
        (record.rates, whole.rates, ('omega',)),
    ):
        if part is None:
            missing += len(all_of_it.stamp_ns)
            continue
        rows = part.stamp_ns // STEP_NS
        np.testing.assert_array_equal(all_of_it.stamp_ns[rows], part.stamp_ns)
        for name in names:
            np.testing.assert_array_equal(getattr(part, name), getattr(all_of_it, name)[rows])
        missing += len(all_of_it.stamp_ns) - len(rows)
    return missing


def test_a_good_bag_has_a_chunk_each_half_second_and_a_checksum_in_each(bag):
    folder, _, data, whole = bag
    assert whole.notes[0] == 'sample times are header stamps'
    assert not any('damage' in note for note in whole.notes)
    found = chunks(data)
    assert len(found) == 5
    assert all(data[start + 33 : start + 37] != b'\0\0\0\0' for start, _ in found)
    with Reader(folder) as reader:  # rosbags compares the checksums
        assert len(list(reader.messages())) == 2 * STEPS


@pytest.mark.parametrize('share', np.linspace(0.0, 1.0, 24).tolist())
def test_a_cut_bag_is_read_up_to_its_last_good_chunk(bag, share):
    folder, path, data, whole = bag
    keep = int(share * len(data)) - 1
    path.write_bytes(data[: max(keep, 0)])
    good = sum(end <= keep for _, end in chunks(data))
    if not good:
        with pytest.raises(RecordingError, match='can not be read as a rosbag2 recording'):
            read_bag(folder, ROBOT)
        return
    record = read_bag(folder, ROBOT)
    assert assert_part_of(record, whole) == 2 * (STEPS - 100 * good)
    if good < 5:
        said = f'is cut short at byte .*: {0.5 * (5 - good):g} s is lost there'
        assert is_said(record, said)
        count = f'read {100 * good} of 500 messages of'
        assert any(count in note and '/imu/data' in note for note in record.notes)


def test_without_metadata_a_cut_bag_is_read_too(bag):
    folder, path, data, whole = bag
    path.write_bytes(data[: chunks(data)[3][0] + 100])
    (folder / 'metadata.yaml').unlink()
    record = read_bag(folder, ROBOT)
    assert assert_part_of(record, whole) == 2 * 200
    assert any('nobody knows how much is lost' in note for note in record.notes)


def test_no_flipped_bit_gives_wrong_numbers(bag, rng):
    folder, path, data, whole = bag
    damaged, silent = np.frombuffer(data, dtype=np.uint8).copy(), 0
    for _ in range(100):
        place, bit = rng.integers(len(data)), np.uint8(1 << rng.integers(8))
        damaged[place] ^= bit
        path.write_bytes(damaged.tobytes())
        with contextlib.suppress(RecordingError):
            record = read_bag(folder, ROBOT)
            missing = assert_part_of(record, whole)
            silent += missing > 0 and not any('damaged' in note for note in record.notes)
            assert missing <= 200  # one chunk of 100 samples of each topic
        damaged[place] ^= bit
    assert silent == 0


@pytest.mark.parametrize('which', range(5))
@pytest.mark.parametrize(
    'offset', [0, 4, 30, 45, 5000]
)  # opcode, length, checksum, sizes, content
def test_one_damaged_chunk_costs_that_chunk(bag, which, offset):
    folder, path, data, whole = bag
    start = chunks(data)[which][0] + offset
    path.write_bytes(data[:start] + bytes([data[start] ^ 0xFF]) + data[start + 1 :])
    record = read_bag(folder, ROBOT)
    assert assert_part_of(record, whole) == 200
    if offset:  # with another opcode it is a record of another kind, which readers skip
        assert is_said(record, 'is damaged at byte .*: 0.5(05)? s is lost there')
    both = '400 of 500 messages of /imu/data, 400 of 500 messages of /joint_states'
    assert is_said(record, f'damaged: read {both}')


def test_a_file_that_metadata_do_not_name_is_said_to_be_left_out(bag):
    folder, _, data, whole = bag
    (folder / 'other.mcap').write_bytes(data)
    record = read_bag(folder, ROBOT)
    assert assert_part_of(record, whole) == 0
    assert is_said(record, r'other\.mcap is not in metadata\.yaml: left out')


def test_what_is_no_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / 'pipe.mcap')
    for path in (tmp_path / 'pipe.mcap', '/dev/zero'):
        with pytest.raises(RecordingError, match='is neither a file nor a folder'):
            read_bag(path, ROBOT)


@contextlib.contextmanager
def disk_of(size):
    """No file can grow beyond a size; what the kernel says then is as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize('size', [0, 20_000, 200_000])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path, rng, size):
    def record():
        with BagWriter(tmp_path / 'bag') as writer:
            fill(writer, rng)

    with disk_of(size), pytest.raises(RecordingError, match='can not be written: File too large'):
        record()
    assert not list(tmp_path.iterdir())


def test_what_a_killed_recorder_leaves_is_read(tmp_path, rng):
    writer = BagWriter(tmp_path / 'bag')
    with writer:
        fill(writer, rng)
        shutil.copytree(tmp_path / '.bag.partial', tmp_path / 'killed')  # as a kill leaves it
    record = read_bag(tmp_path / 'killed', ROBOT)
    # half a second is kept for messages out of order, another for the chunk
    assert len(record.joints.stamp_ns) >= STEPS - 201
    assert any('is cut short' in note for note in record.notes)
