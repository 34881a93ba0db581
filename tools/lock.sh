#!/bin/sh
# Write the locked requirements of every supported Python: names, versions and hashes, no addresses.
set -eu
cd "$(dirname "$0")/../requirements"
UV="${UV:-../.venv/bin/uv}"

# empy is published as source only; everything else has to come as a wheel.
compile() {
    "$UV" pip compile --quiet --upgrade --generate-hashes --no-emit-index-url --no-annotate \
        --python-platform x86_64-manylinux_2_28 --only-binary :all: --no-binary empy \
        --custom-compile-command 'make lock' "$@"
}

for minor in 11 12 13; do
    compile --python-version "3.$minor" ros.in runtime.in dev.in -o "lock-py3$minor.txt"
    compile --python-version "3.$minor" -c "lock-py3$minor.txt" bench.in -o "bench-py3$minor.txt"
done
