#!/usr/bin/env bash
# Pages of `dlsys view` in a real browser: headless Chromium with a graphics processor made of software, the slowest there is.
# Plays the whole growth of models/lychnis.dls and says how many frames a second it gets in each part of it; opens pages of
# other kinds of models; fails on any script error.
#
#   tests/viewer.sh [DIR]    DIR: keep screenshots there
#
# FPS=30 makes fewer frames a second than that a failure; for a quiet machine only.
# Where there is no Chromium and none can be installed, it says so and succeeds. DLSYS names the program, if it is built.
set -euo pipefail
cd "$(dirname "$0")/.."

chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)
if [ -z "$chromium" ] && command -v apt-get > /dev/null && [ "$(id -u)" = 0 ]; then
    (apt-get update && apt-get install -y --no-install-recommends chromium) > /dev/null 2>&1 || true
    chromium=$(command -v chromium || true)
fi
if [ -z "$chromium" ]; then
    echo "viewer.sh: skipped: there is no Chromium here and none could be installed"
    exit 0
fi

work=$(mktemp -d)
browser=
finish() {
    [ -z "$browser" ] || kill "$browser" 2> /dev/null || true
    rm -rf "$work"
}
trap finish EXIT
shots=${1:-}
[ -z "$shots" ] || mkdir -p "$shots"

view() {
    if [ -n "${DLSYS:-}" ]; then "$DLSYS" view "$@"; else cargo run --quiet -- view "$@"; fi
}

flags=(--headless=new --no-sandbox --disable-gpu-sandbox --disable-quic --no-first-run --disable-background-networking
    --disable-component-update --disable-sync --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars)

# open MODEL FLAGS SCRIPT: records a model, opens its page, and prints what the script says: the lines that it gives to
# `say`. They end with its result; anything else that the browser complains about in the page is an error.
open() {
    local model=$1 extra=$2 script=$3 name
    name=$(basename "$model" .dls)
    # shellcheck disable=SC2086  # several flags
    view "$model" -o "$work/$name.html" $extra > /dev/null
    # At the end of a copy of the page, so that it is all there.
    {
        sed '/^<\/body>$/,$d' "$work/$name.html"
        cat << END
<script>
const say = (text) => console.log("viewer.sh: " + text);
addEventListener("error", (event) => say("failed: " + event.message));
addEventListener("unhandledrejection", (event) => say("failed: " + event.reason));
const frame = () => new Promise((done) => requestAnimationFrame(done));
(async () => {
  for (let i = 0; !window.dlsys; i++) {
    if (i > 600) throw new Error(document.getElementById("notice").textContent);
    await frame();
  }
  $script
})().then(() => say("done"), (error) => say("failed: " + error.message));
</script>
</body>
</html>
END
    } > "$work/test.html"
    local log=$work/$name.log
    : > "$log"
    "$chromium" "${flags[@]}" --user-data-dir="$work/profile" --enable-logging=stderr --remote-debugging-port=0 \
        "file://$work/test.html" 2> "$log" > /dev/null &
    browser=$!
    local waited=0
    until grep -qE 'viewer.sh: (done|failed)|"Uncaught' "$log"; do
        sleep 0.2
        waited=$((waited + 1))
        [ "$waited" -lt 450 ] || { echo "viewer.sh: $model: no answer in 90 s"; tail -5 "$log"; exit 1; }
    done
    kill "$browser" 2> /dev/null || true
    wait "$browser" 2> /dev/null || true
    browser=
    sed -n 's/.*CONSOLE[^"]*"viewer.sh: \(.*\)", source.*/\1/p' "$log"
    if ! grep -q 'viewer.sh: done' "$log" || grep -qE 'CONSOLE.*(Uncaught|rror)' "$log"; then
        echo "viewer.sh: $model: the page has failed"
        grep CONSOLE "$log" || true
        exit 1
    fi
    if [ -n "$shots" ]; then
        sed '/^<\/body>$/,$d' "$work/$name.html" > "$work/shot.html"
        echo "<script>(async () => { while (!window.dlsys) await new Promise((r) => setTimeout(r, 20));
            dlsys.play(false); dlsys.seek(dlsys.to); })()</script></body></html>" >> "$work/shot.html"
        "$chromium" "${flags[@]}" --user-data-dir="$work/profile" --window-size=1280,800 \
            --virtual-time-budget=5000 --screenshot="$shots/$name.png" "file://$work/shot.html" > /dev/null 2>&1
    fi
}

# Each sixth of the growth, at the pace of the player, in a window of Chromium's own size. Somebody else may be busy
# on this machine: the best of three.
played=$(open models/lychnis.dls "" '
  const player = window.dlsys;
  player.loops = false;
  let slowest = Infinity;
  for (let part = 0; part < 6; part++) {
    let rate = 0;
    for (let attempt = 0; attempt < 3 && rate < 30; attempt++) {
      const end = player.from + (player.to - player.from) * (part + 1) / 6;
      player.seek(player.from + (player.to - player.from) * part / 6);
      player.play();
      const stamps = [];
      while (player.time < end && player.playing && stamps.length < 120) stamps.push(await frame());
      rate = Math.max(rate, 1000 * (stamps.length - 1) / (stamps.at(-1) - stamps[0]));
    }
    say(`part ${part + 1} of 6: ${rate.toFixed(1)} frames a second, ${player.painter.triangles} triangles`);
    slowest = Math.min(slowest, rate);
  }
  if (!(player.painter.triangles > 1000)) throw new Error("hardly anything is drawn");
  if (slowest < '"${FPS:-0}"') throw new Error(`${slowest.toFixed(1)} frames a second are too few`);') || { echo "$played"; exit 1; }
echo "Lychnis:"
echo "$played"

# Stems and meshes, patches, lines, polygons by the thousand, a sheet, gas, ground, shadows on a floor, nothing at all; orbit and every key.
others='
  const player = window.dlsys, canvas = document.getElementById("plant");
  const colours = () => {
    const gl = canvas.getContext("webgl2"), bytes = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return new Set(new Uint32Array(bytes.buffer)).size;
  };
  for (const key of [..." lpiwasdqe1230c[]-+", "End", "ArrowLeft", "ArrowRight", "Home"]) {
    document.dispatchEvent(new KeyboardEvent("keydown", { key }));
    await frame();
  }
  player.play(false);
  player.seek(player.to);
  await frame();
  await frame();
  say(`${colours()} colours, ${player.painter.triangles} triangles, "${document.getElementById("clock").textContent}"`);
  const error = player.painter.gl.getError();
  if (error) throw new Error(`WebGL error ${error}`);
  // Nothing that is between the light and the floor leaves that as it is.
  if (player.painter.floor && player.recording.light) {
    const lit = colours();
    player.painter.shadows.make(true, () => {});
    player.painter.shadows.change();
    player.painter.shadows.make(true, () => {});
    player.painter.paint(player.camera, canvas.width, canvas.height, true);
    if (!(colours() < lit)) throw new Error("nothing casts a shadow");
    say("shadows are cast");
  }
  const drawn = player.recording.tracks.length > 0 || Boolean(player.recording.clouds);
  if (drawn !== colours() > 1) throw new Error(drawn ? "nothing is to be seen" : "something is to be seen");
  if (drawn === document.getElementById("notice").checkVisibility()) throw new Error("the notice is wrong");'
printf 'initial string: A(1)\nA(x): solve dx/dt = 1\nframes 0 .. 1 step 0.1\n' > "$work/unseen.dls"
for model in models/leaf.dls models/campanula.dls models/anabaena.dls models/petal.dls models/abop/koch-island.dls models/scenes/{flag,smoke,steps-sand,apples}.dls "$work/unseen.dls"; do
    extra=
    case $model in models/scenes/*) extra="--from 0 --to 2 --step 0.25" ;; esac
    [ "$model" != models/campanula.dls ] || extra="--from 0 --to 20 --step 0.5"
    said=$(open "$model" "$extra" "$others") || { echo "$said"; exit 1; }
    echo "$(basename "$model" .dls): $said" | sed '/done$/d'
done
