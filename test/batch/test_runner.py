"""The runner of all campaigns: same records whatever the processes, going on where it stopped."""

import json
import math
from dataclasses import dataclass, replace

import pytest

from spacerobot_ros.batch.runner import Kept
from spacerobot_ros.errors import RecordingError
from validation.campaigns import CAMPAIGNS, Campaign, finish, key, kinds

KEYS = [str(k) for k in range(6)]


@dataclass(frozen=True)
class Rooted(Campaign):
    """A campaign that takes roots and remembers of what."""

    seen: tuple = ()

    def load(self):
        """Itself."""
        return self

    def run(self, text):
        """Return a root, and infinity, which JSON lacks."""
        self.seen.append(text)
        return {'root': math.sqrt(float(text)), 'never': math.inf}


@pytest.fixture
def campaign():
    """Return a campaign that keeps its records."""
    given = {name: getattr(CAMPAIGNS['monitor'], name) for name in Campaign.__dataclass_fields__}
    return Rooted(**{**given, 'name': 'roots'}, seen=[])


def test_goes_on_where_it_stopped_and_adds(tmp_path, campaign):
    steps = []
    first = finish(campaign, KEYS[:3], tmp_path, done=steps.append).records
    again = finish(campaign, KEYS[::-1], tmp_path, done=steps.append).records
    assert campaign.seen == ['0', '1', '2', '5', '4', '3']
    assert [r['case'] for r in again] == KEYS[::-1]
    assert again[3:] == first[::-1]
    assert first[2] == {'case': '2', 'root': math.sqrt(2.0), 'never': None}
    assert steps == [0, 1, 2, 3, 3, 4, 5, 6]


def test_a_line_that_was_cut_off_is_no_trial(tmp_path, campaign):
    finish(campaign, KEYS[:2], tmp_path)
    path = tmp_path / campaign.file
    whole = path.read_text(encoding='utf-8')
    path.write_text(whole + '{"case": cut o', encoding='utf-8')
    assert len(finish(campaign, KEYS[:2], tmp_path).records) == 2
    assert path.read_text(encoding='utf-8') == whole


def test_after_its_time_nothing_new_is_begun(tmp_path, campaign):
    finish(campaign, KEYS[:1], tmp_path)
    later = finish(campaign, KEYS, tmp_path, minutes=-1.0)
    assert [r['case'] for r in later.records] == ['0']


def test_some_are_run_before_others(tmp_path, campaign):
    finish(replace(campaign, alone=('4',)), KEYS, tmp_path)
    assert campaign.seen[0] == '4'


def test_a_campaign_that_keeps_nothing(tmp_path, campaign):
    for _ in range(2):
        assert len(finish(replace(campaign, is_kept=False), KEYS[:1], tmp_path).records) == 1
    assert campaign.seen == ['0', '0']
    assert list(tmp_path.iterdir()) == []


def test_a_trial_that_fails_is_told_and_tried_anew(tmp_path, campaign):
    found = finish(campaign, ['-1', *KEYS[:1]], tmp_path)
    assert list(found.failures) == ['-1']
    assert found.failures['-1'].startswith('ValueError: ')
    assert [r['case'] for r in found.records] == ['0']
    assert campaign.seen == ['-1', '-1', '-1', '0']
    finish(campaign, ['-1', *KEYS[:1]], tmp_path)
    assert campaign.seen[4:] == ['-1', '-1', '-1']


@pytest.mark.parametrize('line', ['{"kind": "clean"}', 'nothing', '[]'])
def test_what_is_no_trial_is_refused(tmp_path, campaign, line):
    finish(campaign, KEYS[:1], tmp_path)
    with (tmp_path / campaign.file).open('a', encoding='utf-8') as file:
        file.write(line + '\n')
    with pytest.raises(RecordingError, match=r'jsonl:2: is no case'):
        Kept(tmp_path / campaign.file).read()


def test_kinds_of_keys():
    records = [{'case': key(*parts)} for parts in (('a', 1), ('b',), ('a', 2.5))]
    assert {kind: len(own) for kind, own in kinds(records).items()} == {'a': 2, 'b': 1}
    assert json.loads(records[2]['case']) == ['a', 2.5]
