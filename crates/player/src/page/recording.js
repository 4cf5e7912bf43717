// The recording: tracks out of their bytes, and what is to be seen at any time.

// Numbers that place a thing, by kind: stem, mesh, patch, polygon and net (three for each corner), mesh scaled by axis.
const WIDTHS = [18, 9, 48, undefined, 12, undefined];
const NET = 5;

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function reader(bytes) {
  let at = 0;
  const natural = () => {
    let number = 0, factor = 1, byte;
    do {
      byte = bytes[at++];
      number += (byte & 127) * factor;
      factor *= 128;
    } while (byte > 127);
    return number;
  };
  const integer = () => {
    const number = natural();
    return number % 2 ? -(number + 1) / 2 : number / 2;
  };
  return { natural, integer };
}

// Tracks as encode.rs describes them, samples in scene units about the middle of the plant.
function decodeTracks(bytes, unit) {
  const { natural, integer } = reader(bytes);
  const tracks = Array.from({ length: natural() }, () => {
    const [kind, detail] = [natural(), natural()];
    const corners = kind === NET ? natural() : detail;
    const [first, span, log2] = [natural(), natural(), natural()];
    const [length, looks] = [natural(), natural()];
    let frame = first;
    const track = { kind, detail, first, last: first + span, stride: 2 ** log2, length };
    track.width = WIDTHS[kind] ?? 3 * corners;
    track.full = Math.ceil(span / track.stride) + 1;
    track.looks = Array.from({ length: looks }, () => {
      frame += natural();
      return { frame, material: natural() - 1, variant: natural() };
    });
    return track;
  });
  for (const track of tracks) {
    const { kind, width, length } = track;
    const samples = (track.samples = new Float32Array(width * length));
    const firsts = new Array(width).fill(0);
    for (let number = 0; number < width; number++) {
      const near = number >= 3 && (kind === 2 || kind === 3 || kind === NET) ? firsts[number - 3] : 0;
      let before = near + integer(), rate = 0;
      firsts[number] = before;
      samples[number] = before * unit;
      for (let i = 1; i < length; i++) {
        rate += integer();
        before += rate;
        samples[i * width + number] = before * unit;
      }
    }
  }
  return tracks;
}

// The look of a track at a frame.
function lookAt(track, frame) {
  const { looks } = track;
  let i = looks.length - 1;
  while (i > 0 && looks[i].frame > frame) i--;
  return looks[i];
}

// Writes the numbers of a track at a place between frames. Past its last frame a thing goes on as it moved.
function placeAt(track, frame, out, at) {
  const { first, last, stride, length, full, width, samples } = track;
  let i = Math.min(Math.floor(Math.max(frame - first, 0) / stride), Math.max(full - 2, 0));
  const start = first + i * stride;
  const span = Math.min(start + stride, last) - start;
  const part = span > 0 ? (frame - start) / span : 0;
  const low = Math.min(i, length - 1) * width;
  const high = Math.min(i + 1, length - 1) * width;
  for (let k = 0; k < width; k++) {
    const a = samples[low + k];
    out[at + k] = a + (samples[high + k] - a) * part;
  }
}

// Place among the frames of a time: a whole number is a frame.
function frameOf(times, time) {
  let low = 0, high = times.length - 1;
  if (!(time > times[0])) return 0;
  if (time >= times[high]) return high;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return low + (time - times[low]) / (times[high] - times[low]);
}

// `count` directions, about evenly spread: a spiral over the sphere.
function directionsAround(count) {
  return Array.from({ length: count }, (_, i) => {
    const y = 1 - (2 * i + 1) / count;
    const [r, a] = [Math.sqrt(1 - y * y), i * 2.399963];
    return [r * Math.cos(a), y, r * Math.sin(a)];
  });
}

// Keeps of the points that it is given those that are outermost in some direction.
function outline(count) {
  const directions = directionsAround(count);
  const best = directions.map(() => [-Infinity]);
  const take = (x, y, z, radius = 0) => {
    directions.forEach((d, n) => {
      const reach = d[0] * x + d[1] * y + d[2] * z + radius;
      if (reach > best[n][0]) best[n] = [reach, [x + radius * d[0], y + radius * d[1], z + radius * d[2]]];
    });
  };
  return { take, points: () => best.flatMap(([, point]) => (point ? [point] : [])) };
}

// Whether a track is ground, which reaches as far as it is declared.
function isGround({ kind, looks }) {
  return (kind === 1 || kind === NET) && looks[0].variant === 1;
}

// How far ground is from the middle of the recording, at most.
function reachOfGround({ tracks }) {
  let most = 0;
  for (const { samples } of tracks.filter((track) => track.kind === NET && isGround(track))) {
    for (let k = 0; k < samples.length; k += 3) most = Math.max(most, Math.hypot(samples[k], samples[k + 1], samples[k + 2]));
  }
  return most;
}

// The points of a recording that are outermost in some direction, over all its frames, ground left out: what the camera fits into
// the page. The box around everything would leave the page half empty.
function outermost({ tracks: all_tracks, meshes, clouds }) {
  const tracks = all_tracks.filter((track) => !isGround(track));
  const all = outline(200);
  const shapes = meshes.map(({ places }) => {
    const shape = outline(40);
    for (let i = 0; i < places.length; i += 3) shape.take(places[i], places[i + 1], places[i + 2]);
    return shape.points();
  });
  // Millions of points say no more than many.
  const taken = ({ kind, detail, length, width }) => length * (kind === 1 ? shapes[detail].length : width / 3);
  const skip = Math.ceil(tracks.reduce((sum, track) => sum + taken(track), 0) / 100000);
  let turn = 0;
  for (const { kind, detail, samples, width, length } of tracks) {
    for (let i = 0; i < length; i++) {
      // The last sample of a track is most often its largest.
      if (turn++ % skip && i < length - 1) continue;
      const n = samples.subarray(i * width, (i + 1) * width);
      if (kind === 0) {
        for (const at of [0, 9]) all.take(n[at], n[at + 1], n[at + 2], Math.hypot(n[at + 3], n[at + 4], n[at + 5]));
      } else if (kind === 1) {
        const across = [n[4] * n[8] - n[5] * n[7], n[5] * n[6] - n[3] * n[8], n[3] * n[7] - n[4] * n[6]];
        const each = 1 / (Math.hypot(n[3], n[4], n[5]) || 1);
        for (const [x, y, z] of shapes[detail]) {
          all.take(...[0, 1, 2].map((k) => n[k] + n[3 + k] * x + n[6 + k] * y + across[k] * each * z));
        }
      } else {
        const places = kind === 2 ? onPatch(n) : n;
        for (let k = 0; k < places.length; k += 3) all.take(places[k], places[k + 1], places[k + 2]);
      }
    }
  }
  for (const [x, y, z, radius] of clouds ? clouds.outermost(10000) : []) all.take(x, y, z, radius);
  return all.points();
}

// Points of a Bézier patch at every third of its sides; its control points may lie far outside.
function onPatch(net) {
  const weights = [0, 1 / 3, 2 / 3, 1].map((u) => [(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u ** 3]);
  const places = new Float32Array(48);
  for (let at = 0; at < 16; at++) {
    for (let from = 0; from < 16; from++) {
      const weight = weights[at >> 2][from >> 2] * weights[at & 3][from & 3];
      for (let k = 0; k < 3; k++) places[3 * at + k] += weight * net[3 * from + k];
    }
  }
  return places;
}
