#!/bin/sh
# Make .venv and the colcon workspace current: silent and quick when they are. All work is done
# by set_up.py; this only finds a Python to run it. PYTHON=... names one, else the first that fits.
set -eu
scripts=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
venv_python=$scripts/../.venv/bin/python

if [ $# -eq 0 ] && [ -x "$venv_python" ] && "$venv_python" -I -S "$scripts/set_up.py" --check 2>/dev/null
then
    exit 0
fi

reasons=
for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 python3.10}; do
    if reason=$("$candidate" "$scripts/probe_python.py" 2>/dev/null); then
        exec "$candidate" "$scripts/set_up.py" "$@"
    elif [ -n "$reason" ]; then
        reasons="$reasons $candidate $reason;"
    elif [ -n "${PYTHON:-}" ]; then
        reasons="$reasons $candidate does not run;"
    fi
done
echo "spacerobot set-up: no fitting Python:${reasons:- none found;} install CPython 3.10 to 3.13" \
    "or name one: make setup PYTHON=/path/to/python3.12" >&2
exit 1
