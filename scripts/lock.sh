#!/bin/sh
# Regenerate the hashed lock files of requirements/ from the *.in files: one file serves every
# supported Python. Names of package indexes never get into them. "make lock" calls this.
set -eu
cd "$(dirname -- "$0")/../requirements"
uv=${UV:-../.venv/bin/uv}

compile() {  # compile OUTPUT ARGUMENT...
    output=$1
    shift
    "$uv" pip compile --quiet --universal --python-version 3.10 --generate-hashes \
        --no-emit-index-url --no-emit-find-links --no-annotate --no-header \
        --output-file "$output" "$@"
    echo "wrote requirements/$output"
}

compile wheels.txt ros.in colcon.in base.in fleet.in test.in dev.in
compile sourced.txt --override sourced-overrides.in --no-emit-package numpy \
    base.in sourced.in fleet.in test.in dev.in
compile colcon.txt colcon.in
compile docs.txt docs.in
compile uv.txt uv.in
