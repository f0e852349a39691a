"""The online identifier across segments, failed solutions and restarts."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
from support.identification import ORIGIN_NS, measure, simulate
from support.online import assert_never_confidently_wrong, events, feed, identifier, same

from spacerobot_ros.errors import ConfigurationError, IdentificationError, RecordingError
from spacerobot_ros.identification.saved_knowledge import load, save
from spacerobot_ros.identification.segment import Segment


def test_data_that_defeat_the_solution_are_left_behind(monkeypatch):
    run = simulate('zyx', 20.0)
    data = measure(run, 7)
    online = identifier()
    feed(online, data.between(-1.0, 9.0))
    known = online.solve()
    with monkeypatch.context() as patch:
        patch.setattr(Segment, '_run_new', fail)
        patch.setattr(Segment, '_run_all', fail)
        for event in events(data.between(9.0, 12.0)):
            getattr(online, event[1])(event[0], *event[2])
        with pytest.raises(IdentificationError, match='another segment begins: defeated'):
            online.solve()
    same(online.solve(), known)
    estimates = []
    for event in events(data.between(12.0, 20.0)):
        getattr(online, event[1])(event[0], *event[2])
    estimates.append(online.solve())
    assert_never_confidently_wrong(estimates, run)
    assert np.all(estimates[-1].std[:3] < known.std[:3])


def fail(*_):
    raise np.linalg.LinAlgError('defeated')


def test_another_segment_keeps_what_is_known_of_the_robot():
    run = simulate('zyx', 20.0)
    data = measure(run, 7)
    online = identifier()
    known = feed(online, data.between(-1.0, 10.0))[-1]
    online.begin_segment()
    same(online.solve(), known)
    # the clock begins anew, and so does the frame in which momentum is measured
    part = data.between(10.0, 20.0)
    estimates = []
    for stamp, method, values in events(part):
        getattr(online, method)(stamp - ORIGIN_NS, *values)
    estimates.append(online.solve())
    assert_never_confidently_wrong(estimates, run)
    alone = feed(identifier(), part)[-1]
    assert np.all(estimates[-1].std[:3] < 0.9 * np.minimum(known.std[:3], alone.std[:3]))
    assert estimates[-1].samples > 1500


def test_what_was_saved_is_known_again(tmp_path):
    run, path = simulate('zyx', 20.0), tmp_path / 'known.json'
    data, online = measure(run, 7), identifier()
    assert online.knowledge is None
    known = feed(online, data.between(-1.0, 10.0))[-1]
    save(path, online.knowledge, 0)
    soon, later = identifier(), identifier()
    soon.go_on(load(path, 0, soon.model))
    assert soon.knowledge is None  # it is saved already, and would pass for younger
    later.go_on(load(path, 100 * 10**9, later.model))
    assert_never_confidently_wrong([soon.solve(), later.solve()], run)
    assert np.all(later.solve().std[:3] > 2.0)  # wheels may run down in 1/0.003 s
    np.testing.assert_allclose(soon.solve().std, known.std, rtol=1e-6, atol=0)
    for name in ('aam', 'parameters', 'covariance'):
        want = getattr(known, name)
        np.testing.assert_allclose(
            getattr(soon.solve(), name), want, rtol=0, atol=1e-6 * np.max(np.abs(want))
        )
    assert soon.solve().sources == known.sources
    assert soon.solve().prior_factor == pytest.approx(known.prior_factor, rel=1e-6)
    tomorrow = load(path, 86_400 * 10**9, soon.model).estimate
    assert np.all(tomorrow.std[:3] > np.abs(known.aam))  # wheels may stand still by then
    np.testing.assert_allclose(tomorrow.std[3:], known.std[3:], rtol=0.1, atol=0)
    part = data.between(10.0, 20.0)
    estimates, alone = feed(soon, part), feed(identifier(), part)[-1]
    assert all(e.valid for e in estimates)
    assert_never_confidently_wrong(estimates, run)
    assert np.all(estimates[-1].std[:3] < 0.9 * alone.std[:3])


def test_what_is_no_file_is_neither_read_nor_moved(tmp_path):
    online, folder, pipe = identifier(), tmp_path / 'folder', tmp_path / 'pipe'
    feed(online, measure(simulate('zyx', 12.0), 7))
    folder.mkdir()
    os.mkfifo(pipe)
    for path in (folder, pipe, Path('/dev/zero')):
        with pytest.raises(RecordingError, match='can not be read: it is not a file'):
            load(path, 0, online.model)
    for path in (folder, pipe):
        with pytest.raises(ConfigurationError, match='can not be written'):
            save(path, online.knowledge, 0)
    assert sorted(p.name for p in tmp_path.iterdir()) == ['folder', 'pipe']


def test_a_torn_file_is_refused_and_the_one_before_used(tmp_path):
    data, online, path = measure(simulate('zyx', 12.0), 7), identifier(), tmp_path / 'known.json'
    feed(online, data.between(-1.0, 9.0))
    save(path, online.knowledge, 0)
    first = identifier()
    first.go_on(load(path, 0, first.model))
    feed(online, data.between(9.0, 12.0))
    save(path, online.knowledge, 0)
    whole = path.read_bytes()
    other = identifier(structure='generic')
    with pytest.raises(RecordingError, match='of another robot'):
        load(path, 0, other.model)
    for k in range(0, len(whole), len(whole) // 17):
        flipped = bytearray(whole)
        flipped[k] ^= 1
        for torn in (whole[:k], bytes(flipped)):
            path.write_bytes(torn)
            again = identifier()
            again.go_on(load(path, 0, again.model))
            same(again.solve(), first.solve())
    for foreign in ('[' * 100_000, '[]', '{"sum": 1, "content": 1}'):
        path.write_text(foreign, encoding='utf-8')
        again = identifier()
        again.go_on(load(path, 0, again.model))
        same(again.solve(), first.solve())
    path.write_bytes(whole[: len(whole) // 2])
    (tmp_path / 'known.json.before').unlink()
    with pytest.raises(RecordingError, match=r'known.json: (is damaged|its check sum)'):
        load(path, 0, online.model)


def test_a_file_of_before_is_refused_in_one_line(tmp_path):
    online, path = identifier(), tmp_path / 'known.json'
    feed(online, measure(simulate('zyx', 9.0), 7))
    save(path, online.knowledge, 0)
    text = json.loads(path.read_text(encoding='utf-8'))['content']
    older = text.replace('"version": 2', '"version": 1')
    assert older != text
    whole = {'sum': hashlib.sha256(older.encode()).hexdigest(), 'content': older}
    path.write_text(json.dumps(whole), encoding='utf-8')
    with pytest.raises(RecordingError, match='is of version 1, not 2') as refusal:
        load(path, 0, online.model)
    assert '\n' not in str(refusal.value)
