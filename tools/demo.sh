#!/usr/bin/env bash
# The main job on a sample recording: replay it over ROS 2 beside the running simulator, publish the
# metrics, have the comparator name what is wrong, hand the simulator the extended machine, replay
# once more; leave a page and the session in out/demo.
#
# tools/demo.sh [BAG [RATE]]   by default bags/sample_guide_step, four times as fast as recorded
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bag="${1:-bags/sample_guide_step}"
rate="${2:-4}"
machine=config/machines/prototype.yaml
out=out/demo
programs=ros2_ws/install/escalator_twin/lib/escalator_twin
jobs="$(nproc)"

# a domain of its own, unless the user has chosen one: another demo may be running
export ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-$((1 + RANDOM % 101))}"
rm -rf "$out"
mkdir -p "$out"

say() { printf '\n== %s\n' "$*"; }

stop() {
    trap - EXIT
    [[ -z "${nodes:-}" ]] || kill -INT $nodes 2>/dev/null || true
    wait || true
}
trap stop EXIT

# wait_for FILE SECONDS: a result of the comparator, which may end without one
wait_for() {
    local k
    for ((k = 0; k < 10 * $2; k++)); do
        [[ ! -s "$1" ]] || return 0
        kill -0 "$comparator" 2>/dev/null || break
        sleep 0.1
    done
    echo "demo: no $1" >&2
    return 1
}

say "replaying $bag at $rate times its speed beside the simulator (domain $ROS_DOMAIN_ID)"
"$programs/simulator" --ros-args -p machine:="$machine" -p autostart:=false &
nodes=$!
"$programs/comparator" --ros-args -p machine:="$machine" -p bag:="$bag" -p rate:="$rate" \
    -p json:="$out/compare.json" -p session:="$out/session" -p exit_at_end:=false &
comparator=$!
nodes="$nodes $comparator"
wait_for "$out/compare.json" 180

say 'how well the twin agrees with the recording'
show() {
    .venv/bin/python - "$1" <<'PYTHON'
import json
import sys

from escalator_twin.cli.compare import show

with open(sys.argv[1], encoding='utf-8') as file:
    print(show(json.load(file)))
PYTHON
}
show "$out/compare.json"

say 'what is wrong: the comparator diagnoses and hands the simulator the extended machine'
"$programs/ask" --hand-over --jobs "$jobs" --json "$out/diagnosis.json" \
    --extended "$PWD/$out/extended.yaml"

say 'the same recording beside the extended machine'
wait_for "$out/compare_extended.json" 120
show "$out/compare_extended.json"
stop

say 'results'
.venv/bin/escalator-twin report "$out/compare.json" "$out/diagnosis.json" \
    "$out/compare_extended.json" --out "$out/report.html" >/dev/null
for file in report.html compare.json diagnosis.json extended.yaml compare_extended.json session \
    session.foxglove.json; do
    echo "  $out/$file"
done
echo "open session/session.mcap in Foxglove or Lichtblick and load session.foxglove.json as layout"
