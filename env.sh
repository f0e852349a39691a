# Gives this shell the environment of spacerobot_ros: source env.sh (bash or zsh).
#
# ROS 2 (sourced, else the wheels in .venv), the colcon workspace, `spacerobot` on PATH; discovery
# stays on this machine unless ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise. Sets up what is missing.
# shellcheck shell=bash

if [ -n "${BASH_VERSION:-}" ]; then
    _spacerobot_root=${BASH_SOURCE[0]}
    _spacerobot_shell=bash
elif [ -n "${ZSH_VERSION:-}" ]; then
    eval '_spacerobot_root=${(%):-%x}'
    _spacerobot_shell=zsh
else
    echo 'spacerobot: env.sh is for bash and zsh' >&2
    return 1
fi
_spacerobot_root=$(CDPATH='' cd -- "$(dirname -- "$_spacerobot_root")" && pwd -P)

# Put a folder first in a path-like variable, once.
_spacerobot_prepend() {
    eval "_spacerobot_value=\${$1:-}"
    case ":$_spacerobot_value:" in
        *":$2:"*) ;;
        *) export "$1=$2${_spacerobot_value:+:$_spacerobot_value}" ;;
    esac
}

_spacerobot_enter() {
    _spacerobot_venv=$_spacerobot_root/.venv
    _spacerobot_prepend PATH "$_spacerobot_venv/bin"
    export VIRTUAL_ENV="$_spacerobot_venv"
    if [ -e "$_spacerobot_venv/spacerobot-library-path" ]; then # ROS 2 is in .venv
        _spacerobot_prepend AMENT_PREFIX_PATH "$_spacerobot_venv"
        _spacerobot_prepend CMAKE_PREFIX_PATH "$_spacerobot_venv"
        _spacerobot_prepend LD_LIBRARY_PATH "$(cat "$_spacerobot_venv/spacerobot-library-path")"
        export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1 # the wheels would start Python twice to do the same
    fi
    case $- in *u*) _spacerobot_nounset=-u ;; *) _spacerobot_nounset=+u ;; esac
    set +u # colcon's scripts read variables that may not be set
    . "$_spacerobot_root/install/local_setup.$_spacerobot_shell"
    set "$_spacerobot_nounset"
    _spacerobot_prepend PYTHONPATH "$_spacerobot_root" # modules come from here, not through links
    export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
}

"$_spacerobot_root/scripts/set_up.sh" && _spacerobot_enter
_spacerobot_status=$?
unset -f _spacerobot_prepend _spacerobot_enter
unset _spacerobot_root _spacerobot_shell _spacerobot_nounset _spacerobot_value _spacerobot_venv
if [ "$_spacerobot_status" -ne 0 ]; then
    unset _spacerobot_status
    return 1
fi
unset _spacerobot_status
