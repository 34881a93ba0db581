# Source this (bash): the virtual environment and the built workspace, as if Jazzy were installed.
# Nodes started here talk to this machine only, unless ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise.

_escalator_root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

unset PYTHONPATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE
export VIRTUAL_ENV="$_escalator_root/.venv"
export PATH="$VIRTUAL_ENV/bin:$PATH"
export AMENT_PREFIX_PATH="$VIRTUAL_ENV"
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"

# colcon's own script does not run under set -u
case $- in *u*) _escalator_nounset=-u ;; *) _escalator_nounset=+u ;; esac
set +u
. "$_escalator_root/ros2_ws/install/local_setup.bash"
set "$_escalator_nounset"
unset _escalator_root _escalator_nounset
