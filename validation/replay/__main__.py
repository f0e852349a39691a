"""Replay: ask about every record of the table, and say what changed.

    make replay              all records, <= 60 minutes on two slow cores; goes on where it stopped
    QUICK=1 make replay      twenty of them, <= 8 minutes
    python -m validation.replay --base CHECKOUT --accept   answers of another checkout, committed

Exit status: 0 nothing got worse, 1 a right answer fell or a wrong one rose, 2 a record or a
command failed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from spacerobot_ros.model.files import write_text

from .asking import DATA, ROOT, ask, is_there
from .changes import changes, summary
from .records import HERE, ChangedRecordError, samples_of, simulate, table
from .scoring import scored, truth_of

COMMITTED = HERE / 'answers.jsonl'
SAMPLES = HERE / 'samples.json'
Answers = dict[str, dict[str, Any]]


def read(path: Path) -> Answers:
    """Answers of a file by their keys; a line that was cut off is asked about again."""
    out: Answers = {}
    for line in path.read_text(encoding='utf-8').splitlines() if path.exists() else ():
        try:
            answer = json.loads(line)
        except ValueError:
            continue
        out[answer['key']] = answer
    return out


def write(path: Path, answers: Iterable[dict[str, Any]]) -> None:
    """One line an answer; whole, or as it was."""
    write_text(path, ''.join(f'{json.dumps(a)}\n' for a in answers))


def fingerprint(checkout: Path) -> str:
    """Of the package's sources: answers of other sources are not gone on with."""
    digest = hashlib.sha256()
    for path in sorted((checkout / 'spacerobot_ros').rglob('*')):
        if path.suffix in ('.py', '.yaml', '.json'):
            digest.update(path.relative_to(checkout).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def asked(lines: Sequence[dict[str, Any]], checkout: Path, out: Path, jobs: int) -> Answers | None:
    """Answers to all lines, those of an earlier run of the same sources among them.

    None where one failed; the others are kept.
    """
    kept = out / f'answers-{fingerprint(checkout)}.jsonl'
    kept.parent.mkdir(parents=True, exist_ok=True)
    answers, failed = read(kept), False
    left = [line for line in lines if line['key'] not in answers]
    for line in lines:  # by the rule as it is now
        if old := answers.get(line['key']):
            old |= {'truth': truth_of(line), 'score': scored(line, old)}
    write(kept, answers.values())  # without a line that was cut off
    print(f'{len(lines) - len(left)} of {len(lines)} are in {kept}', flush=True)
    begun = time.monotonic()
    with ProcessPoolExecutor(jobs) as pool:
        running = {pool.submit(ask, line, checkout, out): line['key'] for line in left}
        for number, future in enumerate(as_completed(running), 1):
            try:
                answer = future.result()
            except (ChangedRecordError, RuntimeError) as error:
                print(f'{running[future]} failed: {error}', file=sys.stderr, flush=True)
                failed = True
                continue
            answers[answer['key']] = answer
            with kept.open('a', encoding='utf-8') as file:
                file.write(json.dumps(answer) + '\n')
            names = ', '.join(answer['names']) or 'no name'
            minutes = (time.monotonic() - begun) / 60.0
            print(
                f'{number}/{len(left)} {minutes:.1f} min  {answer["key"]}: {answer["score"]}, '
                f'{answer["verdict"]}, {names}, CPU {answer["cpu_s"]:.0f} s',
                flush=True,
            )
    return None if failed else {line['key']: answers[line['key']] for line in lines}


def accept(answers: Answers) -> None:
    """Make them the committed ones, in the order of the table."""
    all_of_them = read(COMMITTED) | answers
    write(COMMITTED, [all_of_them[x['key']] for x in table() if x['key'] in all_of_them])
    print(f'{COMMITTED.name}: {len(answers)} of {len(all_of_them)} answers written')


def store_samples(lines: Sequence[dict[str, Any]], out: Path) -> None:
    """Store samples of records that have none; those that are stored stay."""
    stored = json.loads(SAMPLES.read_text(encoding='utf-8')) if SAMPLES.exists() else {}
    for line in lines:
        if 'machine' in line and line['key'] not in stored:
            stored[line['key']] = samples_of(simulate(line, out / 'records'))
            print(f'samples of {line["key"]}', flush=True)
            text = ',\n'.join(f'{json.dumps(k)}: {json.dumps(v)}' for k, v in stored.items())
            SAMPLES.write_text(f'{{\n{text}\n}}\n', encoding='utf-8')


def chosen(is_quick: bool, keys: Sequence[str]) -> list[dict[str, Any]]:
    """Lines that are asked about, without measured data that are not there, which it says."""
    lines = [
        x for x in table() if x['key'] in keys or (not keys and (x.get('quick') or not is_quick))
    ]
    absent = [x['key'] for x in lines if not is_there(x)]
    if absent:
        print(f'skipped, as there are no data in {DATA}: {", ".join(absent)}')
    return [x for x in lines if x['key'] not in absent]


def main() -> int:
    """Ask, compare, say."""
    parser = argparse.ArgumentParser(
        prog='python -m validation.replay',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--quick', action='store_true', help='twenty records')
    parser.add_argument('--base', type=Path, default=ROOT, help='checkout whose package is asked')
    parser.add_argument('--accept', action='store_true', help='write answers.jsonl')
    parser.add_argument('--store-samples', action='store_true', help='of new records')
    parser.add_argument('--out', type=Path, default=ROOT / 'out' / 'replay')
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('keys', nargs='*', help='of records; default: all')
    args = parser.parse_args()
    lines, out = chosen(args.quick, args.keys), args.out.resolve()
    if args.store_samples:
        store_samples(lines, out)
        return 0
    answers = asked(lines, args.base, out, args.jobs)
    if answers is None:
        return 2
    before = read(COMMITTED)
    found = changes(before, answers)
    print('\n'.join(['', *(map(str, found) if found else ['nothing changed'])]))
    print('\n'.join(['', *summary(before, answers)]))
    if args.accept:
        accept(answers)
    return int(any(change.is_worse for change in found))


if __name__ == '__main__':
    sys.exit(main())
