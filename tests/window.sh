#!/usr/bin/env bash
# The window of `dlsys view` on a screen in memory (Xvfb): sliders of models/leaf.dls bring a new picture to the screen within
# 50 ms; a model that is saved is followed, and so is one with a mistake; keys and the pointer do what they should.
#
#   DLSYS=PROGRAM tests/window.sh [DIR]    DIR: keep screenshots there
#
# The program is one built with `--features viewer`, best in release. Without it, or where Xvfb and xdotool are not there and cannot be
# installed, it says so and succeeds.
set -euo pipefail
cd "$(dirname "$0")/.."

dlsys=${DLSYS:-target/release/dlsys}
if [ ! -x "$dlsys" ] || "$dlsys" view models/leaf.dls --screenshot /dev/null 2>&1 | grep -q 'built without the window'; then
    echo "window.sh: skipped: $dlsys is not there or was built without the window (cargo build --release --features viewer)"
    exit 0
fi
if ! { command -v Xvfb && command -v xdotool; } > /dev/null && command -v apt-get > /dev/null && [ "$(id -u)" = 0 ]; then
    (apt-get update && apt-get install -y --no-install-recommends xvfb xdotool libgl1-mesa-dri) > /dev/null 2>&1 || true
fi
if ! { command -v Xvfb && command -v xdotool; } > /dev/null; then
    echo "window.sh: skipped: there is no Xvfb or no xdotool here and they could not be installed"
    exit 0
fi

work=$(mktemp -d)
shots=${1:-$work}
mkdir -p "$shots"
Xvfb -displayfd 5 -screen 0 1280x900x24 5> "$work/display" 2> /dev/null &
screen=$!
trap 'kill "$screen" 2> /dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 50); do
    [ -s "$work/display" ] && break
    sleep 0.1
done
DISPLAY=:$(cat "$work/display")
export DISPLAY
unset WAYLAND_DISPLAY
window() { timeout 180 "$dlsys" view "$@"; }

fail() {
    echo "window.sh: $*"
    exit 1
}

# Sliders: from the change to the new picture on the screen. Somebody else may be busy on this machine: the median counts.
slid=$(window models/leaf.dls --at 7 --slide n_0=6 --slide n_0=3 --slide α_max=40 --slide n_0=7 --slide α_max=75 \
    --slide n_0=2 --slide α_max=50 --slide n_0=5 --slide α_max=65 --screenshot "$shots/leaf-slid.png")
echo "$slid"
median=$(sed -n 's/.*after \([0-9.]*\) ms.*/\1/p' <<< "$slid" | sort -n | sed -n 5p)
echo "leaf: a slider's picture is on the screen after $median ms (median of 9)"
awk -v ms="$median" 'BEGIN { exit !(ms > 0 && ms <= 50) }' || fail "wanted 50 ms"

# Playing.
for model in leaf lychnis; do
    played=$(window "models/$model.dls" --play 5 --screenshot "$shots/$model.png") || fail "$model does not play"
    echo "$model: $played"
    awk '{ exit !($1 >= 10) }' <<< "$played" || fail "wanted 10 pictures a second"
done

# Once the window of a model is there and has shown it: does something beside it.
beside() {
    local id
    id=$(timeout 60 xdotool search --sync --onlyvisible --name "$1" | head -1)
    xdotool windowfocus "$id" || true
    shift
    sleep 1
    "$@"
}

# A model that is saved: the same as the new one seen from the beginning, so time and view are kept.
cp models/leaf.dls "$work/plant.dls"
sed 's/^param α_max = [0-9.]*/param α_max = 30.0/' models/leaf.dls > "$work/changed.dls"
cmp -s "$work/plant.dls" "$work/changed.dls" && fail "the change is none"
window "$work/plant.dls" --at 7 --screenshot "$shots/before.png"
beside plant.dls cp "$work/changed.dls" "$work/plant.dls" &
window "$work/plant.dls" --at 7 --delay 4 --screenshot "$shots/saved.png"
window "$work/plant.dls" --at 7 --screenshot "$shots/changed.png"
cmp -s "$shots/saved.png" "$shots/before.png" && fail "a model that was saved is not shown"
cmp "$shots/saved.png" "$shots/changed.png" || fail "after saving the window is another than that of the new model"
# One with a mistake, and mended again.
cat "$work/changed.dls" - > "$work/mistake.dls" <<< 'F(x: solve dx/dt = 1'
beside plant.dls cp "$work/mistake.dls" "$work/plant.dls" &
window "$work/plant.dls" --at 7 --delay 4 --screenshot "$shots/mistake.png"
cmp -s "$shots/mistake.png" "$shots/changed.png" && fail "a mistake is not shown"
beside plant.dls cp "$work/changed.dls" "$work/plant.dls" &
window "$work/plant.dls" --at 7 --delay 4 --screenshot "$shots/mended.png"
cmp "$shots/mended.png" "$shots/changed.png" || fail "a mended model is not shown"

# Hands.
beside leaf.dls xdotool key Home &
window models/leaf.dls --at 7 --delay 4 --screenshot "$shots/home.png"
window models/leaf.dls --at 0 --screenshot "$shots/first.png"
cmp "$shots/home.png" "$shots/first.png" || fail "the key home does not go to the first time"
# As slowly as hands do it: all within one picture is no dragging.
beside leaf.dls xdotool mousemove 500 400 mousedown 1 sleep 0.1 mousemove 560 420 sleep 0.1 mousemove 640 440 sleep 0.1 mouseup 1 &
window models/leaf.dls --at 7 --delay 4 --screenshot "$shots/turned.png"
window models/leaf.dls --at 7 --screenshot "$shots/leaf-7.png"
cmp -s "$shots/turned.png" "$shots/leaf-7.png" && fail "dragging does not turn the plant"
# A value to begin with; a model that is not there; no screen.
window "$work/plant.dls" --at 7 --set n_0=5 --screenshot "$shots/set.png"
status=0
window "$work/nothing.dls" 2> "$work/said" || status=$?
[ "$status" = 1 ] || fail "a model that is not there gives status $status"
status=0
DISPLAY=:999 window models/leaf.dls --screenshot "$work/none.png" 2> "$work/said" || status=$?
[ "$status" = 1 ] && grep -q -- '-o plant.html' "$work/said" || fail "without a screen: status $status, $(cat "$work/said")"
echo "window.sh: all is well"
