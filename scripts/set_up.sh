#!/bin/bash
# Make .venv and the colcon workspace current: silent and quick when they are.
#
#     scripts/set_up.sh             # what is missing or not current; PYTHON=... names the interpreter
#     scripts/set_up.sh --rebuild   # the workspace again, changed or not
#
# Stamps in .venv and install say what these were made from. A stamp is removed before the work and
# written after it, so a set-up that was killed starts afresh. One set-up runs at a time: the tools
# inherit the lock. A failure is one line on stderr; what the tools said is in log/setup.
set -eu
root=$(cd -- "$(dirname -- "$0")/.." && pwd -P)
cd "$root"
venv=$root/.venv
venv_stamp=$venv/spacerobot-stamp
build_stamp=install/spacerobot-stamp

say() { echo "spacerobot set-up: $*"; }

fail() {
    said=yes
    echo "spacerobot set-up: $*" >&3
    exit 1
}

outside() { # outside LIST: entries of a list like PATH that do not lie in this checkout
    local entry kept='' IFS=:
    for entry in $1; do
        case $entry/ in
            "$root"/* | /) ;;
            *) kept=$kept${kept:+:}$entry ;;
        esac
    done
    printf '%s' "$kept"
}

sourced_ros() { # the prefixes of a sourced ROS 2; nothing where there is none
    local prefix prefixes IFS=:
    [ -n "${ROS_DISTRO:-}" ] || return 0
    prefixes=$(outside "${AMENT_PREFIX_PATH:-}")
    for prefix in $prefixes; do
        [ ! -e "$prefix/share/rclpy/package.xml" ] || printf '%s' "$prefixes"
    done
}

digest() { sha256sum | cut -c 1-64; }

wanted_venv() {
    echo "$venv for ${ros:-ROS 2 from wheels}"
    cat "${locks[@]}" scripts/mend_cmake_exports.py | digest
}

is_venv_current() {
    [ -x "$venv/bin/python" ] && [ -e "$venv_stamp" ] || return 1
    [ "$(head -n 2 "$venv_stamp")" = "$(wanted_venv)" ] || return 1
    [ -z "${PYTHON:-}" ] || [ "$(sed -n 3p "$venv_stamp")" = "$(place_of "$PYTHON")" ]
}

place_of() { realpath -m -- "$(command -v -- "$1" || echo "$1")"; }

# Python code is linked as a folder and does not count; configuration and launch files are linked
# one by one, so their names do. The first line decides whether the build starts from nothing.
wanted_build() {
    { cat "$venv_stamp" && find msg_defs -type f | sort; } | digest
    {
        find msg_defs programs -type f -print0 | sort -z | xargs -0 sha256sum
        cat setup.py setup.cfg pyproject.toml package.xml
        find config launch -type f -not -name '*.pyc' | sort
    } | digest
}

is_build_current() {
    [ -d build/spacerobot_msgs ] && [ -d build/spacerobot_ros ] && [ -e $build_stamp ] &&
        [ "$(cat $build_stamp)" = "$(wanted_build)" ]
}

only_one() {
    local reason
    reason=$( (mkdir -p log/setup && : >> .setup.lock && : > log/setup/set_up.log) 2>&1) ||
        fail "can not write in $root: ${reason##*: }"
    exec 9>> .setup.lock
    exec 2>> log/setup/set_up.log
    flock -n 9 || {
        say 'waiting for another set-up of this folder to finish'
        flock 9
    }
}

# Leave nothing of this checkout, of make and of Python's variables to the tools.
clean_environment() {
    local name value
    unset MFLAGS MAKELEVEL PYTHONHOME VIRTUAL_ENV PYTHONDONTWRITEBYTECODE PYTHONPYCACHEPREFIX
    for name in PATH PYTHONPATH LD_LIBRARY_PATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH \
        COLCON_PREFIX_PATH PKG_CONFIG_PATH; do
        value=$(outside "${!name:-}")
        unset "$name"
        [ -z "$value" ] || export "$name=$value"
    done
    [ -n "$ros" ] || unset PYTHONPATH
    export MAKEFLAGS="-j$(nproc)" COLCON_DEFAULTS_FILE=/dev/null
}

choose_python() {
    local reason reasons='' candidates=(python3 python3.13 python3.12 python3.11 python3.10)
    [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
    for python in "${candidates[@]}"; do
        if reason=$("$python" scripts/probe_python.py ${ros:+sourced} 2> /dev/null); then
            return
        elif [ -n "$reason" ]; then
            reasons="$reasons $python $reason;"
        elif [ -n "${PYTHON:-}" ]; then
            reasons="$reasons $python does not run;"
        fi
    done
    fail "no fitting Python:${reasons:- none found;} install CPython 3.10 to 3.13" \
        'or name one: make setup PYTHON=/path/to/python3.12'
}

require_platform() {
    case $root in
        *[[:space:]:\;\'\"\$\`\\]*)
            fail "colcon can not build under \"$root\": move the checkout to a path without" \
                'spaces, quotes, colons or dollar signs'
            ;;
    esac
    [ -n "$ros" ] || [ "$(uname -sm)" = 'Linux x86_64' ] || fail \
        "no ROS 2 wheels for $(uname -sm), only for Linux on x86_64;" \
        'source a ROS 2 installation (Jazzy, Kilted or later) and try again'
}

require_build_tools() {
    local missing=''
    if [ -n "${CC:-}" ]; then need 'C compiler' "${CC%% *}"; else need 'C compiler' cc gcc clang; fi
    if [ -n "${CXX:-}" ]; then need 'C++ compiler' "${CXX%% *}"; else need 'C++ compiler' c++ g++ clang++; fi
    need cmake cmake
    need make make
    [ -z "$missing" ] || fail "not found on PATH: ${missing:2}; needed to build the messages" \
        '(on Debian and Ubuntu: apt install build-essential cmake)'
}

need() { # need WHAT NAME...: any of these programs
    local name names what=$1
    shift
    for name in "$@"; do
        command -v "$name" > /dev/null && return
    done
    printf -v names '%s or ' "$@"
    [ "$what" = "$1" ] || what="$what (${names% or })"
    missing="$missing, $what"
}

run() { # run LOG WHAT OTHERWISE COMMAND...: where it fails, say the cause that the log gives away
    local log=log/setup/$1 what=$2 cause=$3
    shift 3
    echo "\$ $*" >> "$log"
    "$@" >> "$log" 2>&1 < /dev/null && return
    ! grep -qi 'do not match the hashes\|hash mismatch' "$log" ||
        cause='a downloaded package does not match its locked hash'
    ! grep -q 'No space left on device' "$log" || cause='the disk is full'
    fail "$what failed: $cause; see $root/$log"
}

# What the lock files say and nothing else; with pip, ten times slower, where uv does not work.
install_locked() {
    local lock pip=("$python" -m pip --python "$venv/bin/python" --disable-pip-version-check
        install --no-deps --require-hashes --retries 1 --timeout 20)
    "$python" -m pip --python "$venv/bin/python" --version > /dev/null 2>&1 || {
        "$venv/bin/python" -m ensurepip
        pip[0]=$venv/bin/python
        unset 'pip[3]' 'pip[4]'
    }
    local uv=$venv/bin/uv
    case $(uv --version 2> /dev/null) in
        '' | 'uv 0.'[0-4].*) ;;
        *) uv=$(command -v uv) ;;
    esac
    if [ ! -x "$uv" ]; then
        sed -n '/^uv==/,/[^\\]$/p' "${locks[0]}" > "$venv/uv.txt"
        "${pip[@]}" -r "$venv/uv.txt" || true
    fi
    "$uv" pip sync --python "$venv/bin/python" --require-hashes "${locks[@]}" ||
        for lock in "${locks[@]}"; do
            "${pip[@]}" -r "$lock" || return
        done
}

make_venv() {
    local wanted made=''
    wanted=$(wanted_venv)
    [ ! -e "$venv_stamp" ] || made=$(sed -n '1p;3p' "$venv_stamp")
    rm -f "$venv_stamp" log/setup/packages.log
    if [ "$made" != "${wanted%%$'\n'*}
$(place_of "$python")" ]; then
        rm -rf "$venv"
        run packages.log 'making .venv' "$python -m venv does not work" \
            "$python" -m venv --without-pip ${ros:+--system-site-packages} "$venv"
    fi
    # a sourced ROS 2 may have its own colcon
    [ -z "$ros" ] || ! "$python" -c 'import colcon_core, colcon_cmake, colcon_ros' || unset 'locks[1]'
    run packages.log "installing ${locks[*]}" \
        'no network, or no package index that has these packages' install_locked
    if [ -z "$ros" ]; then
        run packages.log 'mending the CMake exports' 'unexpected wheels' \
            "$venv/bin/python" scripts/mend_cmake_exports.py
        printf '%s:' "$venv/lib" "$venv"/lib/python3.*/site-packages/ros_*.libs \
            | sed 's/:$//' > "$venv/spacerobot-library-path"
    fi
    { echo "$wanted" && place_of "$python" && date +%s%N; } > "$venv_stamp.draft"
    mv "$venv_stamp.draft" "$venv_stamp"
}

build() {
    local program wanted fewer=OFF
    wanted=$(wanted_build)
    export PATH="$venv/bin:$PATH"
    if [ -z "$ros" ]; then
        export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
        LD_LIBRARY_PATH=$(cat "$venv/spacerobot-library-path")
        export LD_LIBRARY_PATH
        fewer=ON
    fi
    [ "$(head -n 1 $build_stamp 2> /dev/null)" = "${wanted%%$'\n'*}" ] || rm -rf build install
    rm -f $build_stamp log/setup/build.log
    run build.log 'colcon build' 'the log names the first error' "$venv/bin/python" -c \
        'import sys; from colcon_core.command import main; sys.exit(main())' \
        --log-base log build --symlink-install --base-paths . msg_defs --cmake-args \
        -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$venv/bin/python" \
        -DPython3_FIND_VIRTUALENV=ONLY "-DSPACEROBOT_FOR_PYTHON=$fewer" --no-warn-unused-cli
    for program in programs/*; do
        [ -x "install/spacerobot_ros/lib/spacerobot_ros/${program##*/}" ] ||
            fail "colcon build failed: ${program##*/} not installed; see $root/log/setup/build.log"
    done
    ln -sf "$root/install/spacerobot_ros/lib/spacerobot_ros/spacerobot" "$venv/bin/spacerobot"
    echo "$wanted" > $build_stamp.draft
    mv $build_stamp.draft $build_stamp
}

finish() { # whatever ended it, in one line
    local status=$? last
    [ $status -ne 0 ] && [ -z "${said:-}" ] || return 0
    last=$(tail -n 1 log/setup/set_up.log 2> /dev/null)
    echo "spacerobot set-up: ${last:-ended with status $status: is the disk full?}" >&3
}

exec 3>&2
trap finish EXIT
trap 'said=yes; echo "spacerobot set-up: interrupted; the next run starts afresh" >&3; exit 130' INT TERM
ros=$(sourced_ros)
locks=(requirements/wheels.txt)
[ -z "$ros" ] || locks=(requirements/sourced.txt requirements/colcon.txt)
if [ $# -eq 0 ] && is_venv_current && is_build_current; then exit 0; fi 2> /dev/null

only_one
start=$SECONDS
clean_environment
if ! is_venv_current; then
    choose_python
    require_platform
    require_build_tools
    [ -n "$ros" ] && source='for the sourced ROS 2' || source='with ROS 2 from wheels'
    say "making .venv, $("$python" -V), $source (10 s to minutes)"
    make_venv
fi
if [ $# -gt 0 ] || ! is_build_current; then
    require_build_tools
    say 'building messages with colcon, once (10 s to a minute)'
    build
    say "done in $((SECONDS - start)) s"
fi
