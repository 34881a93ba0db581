#!/usr/bin/env bash
# The twin beside the independent generator, both as designed, in half of the 16 experiments:
# what is left per channel and band, as a table and in docs/floor.json. Takes some minutes.
#
# tools/floor.sh [--rails N]   N drawn rails beside it, see python -m rig floor --help
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
bags=()
# every pair of levels of two factors occurs twice
for case in 0.25,up,0,3000 0.25,up,75,6000 0.25,down,0,6000 0.25,down,75,3000 \
    0.5,up,0,6000 0.5,up,75,3000 0.5,down,0,3000 0.5,down,75,6000; do
    IFS=, read -r speed direction load preload <<< "$case"
    duration=70  # s: more than a loop, and what the fit leaves out at the ends
    if [[ "$speed" == 0.25 ]]; then duration=120; fi
    bag="$out/${case//,/_}"
    .venv/bin/escalator-twin simulate --machine config/machines/prototype.yaml \
        --case "speed=$speed,direction=$direction,load=$load,preload=$preload" \
        --duration "$duration" --start-s 5.0 --instruments ideal --out "$bag" >&2
    bags+=("$bag")
done
cd tests
../.venv/bin/python -m rig floor "${bags[@]}" --out ../docs/floor.json "$@"
