#!/usr/bin/env bash
# Build everything in the checkout: the virtual environment .venv (ROS 2 Jazzy and all else, from
# locked wheels), then the colcon workspace in ros2_ws. What is up to date is not built again.
#
# setup.sh --check only says what is missing on this machine.
# PYTHON=/path/to/python3.12 picks the interpreter (3.11, 3.12 or 3.13).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root="$PWD"
venv="$root/.venv"

say() { echo "setup: $*"; }
die() { printf 'setup: %s\n' "$@" >&2; exit 1; }

# A ROS that is sourced here belongs to another interpreter: this build does not look at it.
unset PYTHONPATH PYTHONHOME CMAKE_PREFIX_PATH COLCON_PREFIX_PATH AMENT_PREFIX_PATH
unset LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE VIRTUAL_ENV CONDA_PREFIX

# --- what has to be there ------------------------------------------------------------------------

# Print "3.12" where $1 is a usable interpreter: right version, venv, pip and headers.
python_minor() {
    "$1" -c '
import ensurepip, os, sys, sysconfig, venv
ok = (3, 11) <= sys.version_info[:2] <= (3, 13) and sys.implementation.name == "cpython"
ok = ok and os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h"))
print(*sys.version_info[:2], sep=".") if ok else sys.exit(1)' 2>/dev/null
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3.12 python3.11 python3.13 python3 /usr/bin/python3}; do
        if minor="$(python_minor "$candidate")"; then
            python="$candidate"
            return 0
        fi
    done
    return 1
}

missing=()
[[ "$root" != *[[:space:]]* ]] || missing+=("the path of this checkout must not contain spaces: '$root'")
[[ "$(uname -sm)" == 'Linux x86_64' ]] \
    || missing+=("the ROS 2 wheels exist for Linux x86_64 only, this is $(uname -sm)")
find_python || missing+=(
    "no usable Python${PYTHON:+ at PYTHON=$PYTHON}: need CPython 3.11, 3.12 or 3.13 with venv and headers (Debian, Ubuntu: apt install python3-venv python3-dev)")
command -v cmake >/dev/null || missing+=('no cmake: need 3.16 or later (apt install cmake)')
command -v make >/dev/null || missing+=('no make (apt install make)')
command -v "${CC:-cc}" >/dev/null || missing+=('no C compiler (apt install gcc)')
command -v "${CXX:-c++}" >/dev/null || missing+=('no C++ compiler (apt install g++)')
[[ ${#missing[@]} -eq 0 ]] || die "${missing[@]}"
[[ "${1:-}" != --check ]] || exit 0

# Two builds of one checkout at the same time would spoil each other.
exec 9>ros2_ws/.setup.lock
flock 9

# --- virtual environment -------------------------------------------------------------------------

lock="requirements/lock-py${minor/./}.txt"
origin="$root $("$python" -c 'import sys; print(sys.base_prefix, *sys.version_info)')"

install_packages() {
    rm -rf "$venv"
    "$python" -m venv "$venv"
    # The lock's own uv first: it installs the rest in a tenth of pip's time.
    awk '/^[a-z0-9]/ { wanted = /^uv==/ } wanted' "$lock" >"$venv/uv.txt"
    local options=(--quiet --require-hashes)
    local pip=("$venv/bin/python" -m pip --disable-pip-version-check install "${options[@]}")
    "${pip[@]}" -r "$venv/uv.txt" || die 'pip could not install uv (see above)'
    # Not "uv pip sync": the ROS wheels carry metadata of their parts, which it takes for strangers
    # and removes. Where uv cannot reach an index, pip may know a mirror or a proxy.
    # Compiled once: where Python may not write what it compiles, each command would take seconds more.
    "$venv/bin/uv" pip install --python "$venv/bin/python" --compile-bytecode "${options[@]}" -r "$lock" \
        || "${pip[@]}" -r "$lock" \
        || die "the packages of $lock could not be installed (see above)"
}

# The source tree itself is imported, and the command works without anything being sourced.
link_source_tree() {
    local site
    site="$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
    echo "$root/escalator_twin" >"$site/escalator_twin_source.pth"
    cat >"$venv/bin/escalator-twin" <<SCRIPT
#!$venv/bin/python
import sys

from escalator_twin.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
SCRIPT
    chmod +x "$venv/bin/escalator-twin"
}

packages_wanted="$( (echo "$origin"; cat "$lock") | sha256sum)"
if [[ "$(cat "$venv/.packages" 2>/dev/null)" != "$packages_wanted" ]]; then
    say "virtual environment .venv with Python $minor, $(grep -c '^[a-z0-9].*==' "$lock") packages"
    install_packages
    echo "$packages_wanted" >"$venv/.packages"
    rm -rf ros2_ws/build ros2_ws/install ros2_ws/log
fi

finish_wanted="$( (declare -f link_source_tree; cat tools/fix_ros_wheels.py) | sha256sum)"
if [[ "$(cat "$venv/.finish" 2>/dev/null)" != "$finish_wanted" ]]; then
    "$venv/bin/python" tools/fix_ros_wheels.py
    link_source_tree
    echo "$finish_wanted" >"$venv/.finish"
fi

# --- workspace -----------------------------------------------------------------------------------

# Python sources are linked, not copied: only what colcon generates or lists calls for a build.
workspace_state() {
    echo "$packages_wanted"
    find escalator_msgs -type f -print0 | sort -z | xargs -0 sha256sum
    sha256sum escalator_twin/package.xml escalator_twin/setup.py escalator_twin/setup.cfg
    # launch/ and config/ may be missing
    find -L escalator_twin/{launch,config,resource} -type f 2>/dev/null | sort || true
}
workspace_wanted="$(workspace_state | sha256sum)"
stamp=ros2_ws/install/.stamp

if [[ "$(cat "$stamp" 2>/dev/null)" != "$workspace_wanted" ]]; then
    say 'colcon workspace ros2_ws'
    # a build by hand may have copied where this one links
    [[ -e "$stamp" ]] || rm -rf ros2_ws/build ros2_ws/install
    mkdir -p ros2_ws/install
    echo building >"$stamp"
    (
        export VIRTUAL_ENV="$venv" PATH="$venv/bin:$PATH" AMENT_PREFIX_PATH="$venv"
        export PYTHONWARNINGS=ignore
        # colcon's own choice also waits while the machine is busy with something else
        export MAKEFLAGS="-j$(nproc)"
        cd ros2_ws
        colcon --log-level error build --symlink-install --base-paths src \
            --event-handlers console_stderr- console_cohesion- desktop_notification- \
            --cmake-args -DPython3_EXECUTABLE="$venv/bin/python" -DBUILD_TESTING=OFF \
            || die "colcon build failed: see $root/ros2_ws/log/latest_build"
    )
    echo "$workspace_wanted" >"$stamp"
fi

# What has changed of the package itself: as above.
"$venv/bin/python" -m compileall -q escalator_twin/escalator_twin

# --- compiled physics ----------------------------------------------------------------------------

# The first run of each kind of machine compiles its physics: not in somebody's first diagnosis.
physics=escalator_twin/escalator_twin/physics
compiled_wanted="$( (echo "$packages_wanted"; find "$physics" -name '*.py' -print0 | sort -z | xargs -0 cat) | sha256sum)"
if [[ "$(cat "$venv/.compiled" 2>/dev/null)" != "$compiled_wanted" ]]; then
    say 'physics, compiled once (half a minute)'
    tried="$(mktemp -d)"
    trap 'rm -rf "$tried"' EXIT
    for machine in prototype kwon; do
        "$venv/bin/escalator-twin" simulate --machine "config/machines/$machine.yaml" \
            --case speed=0.5,direction=up,load=75,preload=3000 --duration 1 \
            --out "$tried/$machine" >"$tried/$machine.log" 2>&1 \
            || die "the physics of config/machines/$machine.yaml does not run:" "$(cat "$tried/$machine.log")"
    done
    echo "$compiled_wanted" >"$venv/.compiled"
fi
