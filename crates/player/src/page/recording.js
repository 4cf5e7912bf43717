// The recording: tracks out of their bytes, and what is to be seen at any time.

// Numbers that place a thing, by kind: stem, mesh, patch, polygon (three for each corner), mesh scaled by axis.
const WIDTHS = [18, 9, 48, undefined, 12];

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
    const [kind, detail, first, span, log2] = [natural(), natural(), natural(), natural(), natural()];
    const [length, looks] = [natural(), natural()];
    let frame = first;
    const track = { kind, detail, first, last: first + span, stride: 2 ** log2, length };
    track.width = WIDTHS[kind] ?? 3 * detail;
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
      const near = number >= 3 && (kind === 2 || kind === 3) ? firsts[number - 3] : 0;
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
