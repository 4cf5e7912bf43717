#!/usr/bin/env bash
# glb.sh TOOLS: writes some models as GLB files and checks them in other programs, as far as these are installed. TOOLS is a folder with
# node_modules (gltf-validator) and venv (bpy, numpy); DLSYS the program.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
tools=${1:-.}
dlsys=${DLSYS:-$here/../../target/release/dlsys}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
for model in leaf dragon campanula lychnis; do
    "$dlsys" run "$here/../../models/$model.dls" --format glb -o "$out/$model.glb"
done
if [ -d "$tools/node_modules/gltf-validator" ]; then
    (cd "$tools" && node "$here/validate.mjs" "$out"/*.glb)
else
    echo "SKIPPED: gltf-validator is not in $tools/node_modules"
fi
if [ -x "$tools/venv/bin/python" ]; then
    for model in lychnis campanula; do
        "$tools/venv/bin/python" "$here/compare.py" "$dlsys" "$here/../../models/$model.dls" "$out/$model.glb"
    done
    "$tools/venv/bin/python" "$here/blender.py" "$out"/*.glb
else
    echo "SKIPPED: there is no $tools/venv/bin/python with bpy and numpy"
fi
