#!/bin/sh
# Runs a command N times, as far as the first failure; --busy: beside two loops that want a
# processor each, and end with this script, whatever ends it.
# usage: scripts/repeat.sh N [--busy] -- COMMAND...
set -u

busy() {
    while kill -0 $$ 2> /dev/null; do
        i=0
        while [ $i -lt 10000 ]; do i=$((i + 1)); done
    done
}

usage() {
    sed -n '/^# usage: /s/^# //p' "$0" >&2
    exit 2
}

times=${1:-}
[ "$times" -gt 0 ] 2> /dev/null || usage
shift
if [ "${1:-}" = --busy ]; then
    shift
    busy & busy &
fi
[ "${1:-}" = -- ] && [ $# -gt 1 ] || usage
shift
k=1
while [ $k -le "$times" ]; do
    "$@" || { echo "run $k of $times failed" >&2; exit 1; }
    k=$((k + 1))
done
echo "$times of $times runs passed" >&2
