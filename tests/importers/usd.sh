#!/usr/bin/env bash
# usd.sh [VENV [BLENDER]]: writes some models as USD files, runs the validators of OpenUSD on them and compares them with OBJ files at random times. VENV is a
# Python environment with usd-core and numpy; without it one is made in a temporary folder, from PyPI. BLENDER is one with bpy and numpy; without it Blender is left
# out. DLSYS is the program.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
models=$here/../../models
dlsys=${DLSYS:-$here/../../target/release/dlsys}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
venv=${1:-$out/venv}
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet usd-core numpy
fi
for model in leaf dragon campanula lychnis; do
    "$dlsys" run "$models/$model.dls" --format usda -o "$out/$model.usda"
done
"$dlsys" render "$models/lychnis.dls" --at 5.5 --format usda -o "$out/still.usda"
"$venv/bin/python" "$here/usd.py" "$out"/*.usda
for model in leaf lychnis campanula; do
    "$venv/bin/python" "$here/compare.py" "$dlsys" "$models/$model.dls" "$out/$model.usda"
done
if [ -x "${2:-}/bin/python" ]; then
    for model in leaf lychnis campanula; do
        "$2/bin/python" "$here/blender_usd.py" show "$out/$model.usda" "$out/$model.npz"
        "$venv/bin/python" "$here/blender_usd.py" compare "$out/$model.usda" "$out/$model.npz"
    done
else
    echo "SKIPPED: no Python with bpy and numpy is named for Blender"
fi
