"""Whether a change of the engine changed an answer: recordings in, one line an answer out.

`make replay` asks the public command line (`--json` alone) about recordings of real machines, of
machines with hidden effects and of flights, and says in words what differs from `answers.jsonl`,
which is committed.
"""
