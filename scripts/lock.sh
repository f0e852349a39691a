#!/bin/sh
# Regenerate the hashed lock files of requirements/ from pyproject.toml: one file serves every
# supported Python. Names of package indexes never get into them. "make lock" calls this.
set -eu
cd "$(dirname -- "$0")/.."

lock() {  # lock NAME ARGUMENT...
    output=requirements/$1.txt
    shift
    .venv/bin/uv pip compile --quiet --universal --python-version 3.10 --generate-hashes \
        --no-emit-index-url --no-emit-find-links --no-annotate --no-header --output-file "$output" "$@"
    echo "wrote $output"
}

lock wheels pyproject.toml --extra ros --extra fleet --extra meshes --extra test --group build --group tools
lock sourced pyproject.toml --extra fleet --extra meshes --extra test --group tools \
    --override requirements/sourced.in --no-emit-package numpy
lock colcon --group build
sed -n "/^docs = \[/,/^\]/s/^ *'\([^']*\)'.*/\1/p" pyproject.toml | lock docs -
