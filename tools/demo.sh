#!/usr/bin/env bash
# The main job on a sample recording: replay it over ROS 2 beside the running simulator, publish
# and show the metrics, leave a page and the session in out/demo.
#
# tools/demo.sh [BAG [RATE]]   by default bags/sample_clean, four times as fast as it was recorded
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bag="${1:-bags/sample_clean}"
rate="${2:-4}"
machine=config/machines/prototype.yaml
out=out/demo
programs=ros2_ws/install/escalator_twin/lib/escalator_twin

# a domain of its own, unless the user has chosen one: another demo may be running
export ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-$((1 + RANDOM % 101))}"
rm -rf "$out"
mkdir -p "$out"

say() { printf '\n== %s\n' "$*"; }

say "replaying $bag at $rate times its speed beside the simulator (domain $ROS_DOMAIN_ID)"
if command -v ros2 >/dev/null && ros2 pkg prefix launch_ros >/dev/null 2>&1; then
    ros2 launch escalator_twin twin.launch.py "bag:=$bag" "machine:=$machine" "rate:=$rate" \
        "json:=$out/compare.json" "session:=$out/session"
else
    # the wheels hold no launch: the same two programs with the same parameters
    "$programs/simulator" --ros-args -p machine:="$machine" -p autostart:=false &
    simulator=$!
    trap 'kill -INT "$simulator" 2>/dev/null || true' EXIT
    "$programs/comparator" --ros-args -p machine:="$machine" -p bag:="$bag" -p rate:="$rate" \
        -p json:="$out/compare.json" -p session:="$out/session" -p exit_at_end:=true
    kill -INT "$simulator"
    wait "$simulator" || true
    trap - EXIT
fi

say 'how well the twin agrees with the recording'
.venv/bin/python - "$out/compare.json" <<'PYTHON'
import json
import sys

from escalator_twin.cli.compare import show

with open(sys.argv[1], encoding='utf-8') as file:
    print(show(json.load(file)))
PYTHON

say 'results'
.venv/bin/escalator-twin report "$out/compare.json" --out "$out/report.html" >/dev/null
for file in report.html compare.json session session.foxglove.json; do
    echo "  $out/$file"
done
echo "open session/session.mcap in Foxglove or Lichtblick and load session.foxglove.json as layout"
