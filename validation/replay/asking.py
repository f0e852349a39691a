"""Asks the command line about one line of the table, and keeps what the answer rests on."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .records import HERE, made
from .scoring import scored, truth_of

ROOT = HERE.parents[1]
DATA = Path(os.environ.get('SPACEROBOT_DATA', ROOT.parent / 'shared' / 'data'))
_MAIN = 'import sys; from spacerobot_ros.cli.main import main; sys.exit(main())'
_HUNG = 1800.0  # s: ten times the slowest answer
_DIGITS = 6
Answer = dict[str, Any]


def is_there(line: Mapping[str, Any]) -> bool:
    """Whether the measured data of a line are on this machine; simulated records always are."""
    return all((DATA / name).exists() for name in _files(line))


def _files(line: Mapping[str, Any]) -> list[str]:
    further = [name for names in line.get('options', {}).values() for name in names]
    own = [line['urdf']] if 'urdf' in line else []
    return [*line.get('data', ()), *further, *own]


def ask(line: Mapping[str, Any], checkout: Path, out: Path) -> Answer:
    """The scored answer of a checkout's command line to a line of the table.

    Raises:
        ChangedRecordError: the record is not the one that was asked about before.
        RuntimeError: the command failed otherwise than by refusing the data, or hung.
    """
    folder = _real(line, out) if 'data' in line else made(line, out / 'records')
    words = _words(line, folder)
    env = os.environ | {'PYTHONPATH': _path(checkout), 'OMP_NUM_THREADS': '1'}
    used, command = _cpu_s(), [sys.executable, '-W', 'ignore', '-c', _MAIN, *words]
    try:
        ended = subprocess.run(
            command,
            cwd=folder,
            env=env,
            capture_output=True,
            text=True,
            timeout=_HUNG,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise RuntimeError(f'{line["key"]}: no answer in {_HUNG:.0f} s') from error
    answer = {'key': line['key'], 'asked': line['asked']}
    answer |= _read(line['asked'], ended, line['key']) | {'cpu_s': round(_cpu_s() - used, 1)}
    return answer | {'truth': truth_of(line), 'score': scored(line, answer)}


def _path(checkout: Path) -> str:
    rest = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    return os.pathsep.join([str(checkout.resolve()), *filter(None, rest)])


def _cpu_s() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _real(line: Mapping[str, Any], out: Path) -> Path:
    """A folder with the robot file and mapping of `config/examples`, and the data set's URDF."""
    folder = out / 'records' / line['key']
    folder.mkdir(parents=True, exist_ok=True)
    examples = ROOT / 'config' / 'examples'
    for source in (HERE / 'robots', examples):
        for path in source.glob(f'{line["robot"]}*'):
            shutil.copyfile(path, folder / path.name)
    if 'urdf' in line:
        urdf = (DATA / line['urdf']).read_text(encoding='utf-8')
        if line.get('lacks_world'):  # a parent that its URDF names and does not have
            urdf = urdf.replace('<link', '<link name="world"/><link', 1)
        (folder / Path(line['urdf']).name).write_text(urdf, encoding='utf-8')
    return folder


def _words(line: Mapping[str, Any], folder: Path) -> list[str]:
    """The command line, as docs/diagnosis.md has it."""
    asked, robot = line['asked'], line.get('robot', 'robot')
    data = [str(DATA / name) for name in line.get('data', ())]
    if not data:
        data = ['before.npz', 'data.npz'] if asked == 'compare' else ['data.npz']
    words = [asked, *data, '--robot', f'{robot}.yaml', '--json']
    words += ['--map', f'{robot}_map.yaml' if 'data' in line else 'map.yaml']
    for option, names in line.get('options', {}).items():
        words += [option, *(str(DATA / name) for name in names)]
    if asked in ('diagnose', 'compare'):
        words += ['--out', str(folder / 'out'), '--force']
    return [*words, '--no-closed-loop'] if asked == 'diagnose' else words


def _read(asked: str, ended: subprocess.CompletedProcess[str], key: str) -> Answer:
    """What is kept of an answer; exit status 2 is a refusal, and says why."""
    if ended.returncode == 2:
        return _kept('refused') | {'reason': ended.stderr.strip().splitlines()[-1]}
    if ended.returncode not in (0, 1):
        raise RuntimeError(f'{key}: {asked} ended with {ended.returncode}\n{ended.stderr[-2000:]}')
    said = json.loads(ended.stdout)
    if asked == 'identify':
        return _identified(said)
    if asked == 'check':
        return _kept(said['verdict']) | {'findings': [*said['findings'], *said['faults']]}
    causes = said['causes']
    out = _kept(said['verdict'], [name_of(c) for c in causes])
    out['values'] = {name_of(c): _values(c['parameters']) for c in causes}
    rivals = {name_of(c): [name_of(r) for r in c['indistinguishable_from']] for c in causes}
    out['rivals'] = {name: others for name, others in rivals.items() if others}
    if minor := [name_of(c) for c in said.get('minor', ())]:
        out['minor'] = minor
    if events := said.get('events'):
        out['events'] = [f'{name_of(e)} at {e["start"]:.1f} s' for e in events]
    if 'score' in said:
        out['rms_of_another_run'] = _short(said['score']['rms_after'])
    return out


def _kept(verdict: str, names: list[str] | None = None) -> Answer:
    return {'verdict': verdict, 'names': names or [], 'values': {}}


def _identified(said: Mapping[str, Any]) -> Answer:
    momentum = said['aam']
    pairs = zip('xyz', momentum['value'], momentum['std'], strict=True)
    values = {axis: [_short(value), _short(std)] for axis, value, std in pairs}
    verdict = 'valid' if said['valid'] else 'not valid'
    return _kept(verdict) | {'values': {'wheel momentum': values}, 'reason': said['reason']}


def name_of(cause: Mapping[str, Any]) -> str:
    """`effect@place`; an effect of the whole has no place."""
    return f'{cause["effect"]}@{cause["where"]}' if cause['where'] else str(cause['effect'])


def _values(parameters: Mapping[str, Any]) -> dict[str, list[float | None]]:
    return {p: [_short(e['value']), _short(e.get('std'))] for p, e in parameters.items()}


def _short(value: float | None) -> float | None:
    return None if value is None else float(f'{value:.{_DIGITS}g}')
