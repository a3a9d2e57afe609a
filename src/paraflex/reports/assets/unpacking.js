"use strict";
// Numbers of pages as `packing` of Python compresses them: for reports, and for the workbench.
async function inflated(text) {
  const letters = atob(text), packed = new Uint8Array(letters.length);
  for (let k = 0; k < packed.length; k++) packed[k] = letters.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// All first bytes come first, then all second ones.
function gathered(bytes, width) {
  const count = bytes.length / width;
  const out = new Uint8Array(bytes.length);
  for (let part = 0, from = 0; part < width; part++) {
    for (let k = part; k < out.length; k += width) out[k] = bytes[from++];
  }
  return { buffer: out.buffer, count };
}

// Rows of numbers of curves, stored together.
async function seriesRows({ data, lengths }) {
  const { buffer } = gathered(await inflated(data), 4);
  let from = 0;
  return lengths.map((length) => {
    const row = new Float32Array(buffer, 4 * from, length);
    from += length;
    return row;
  });
}

// An array (runs, frames, ...) with x, y last, in metres; NaN where there is nothing. It is stored as differences over
// frames and then over points, each of some order, with the sign in the lowest bit.
async function unpacked(array) {
  const { buffer } = gathered(await inflated(array.data), 2);
  const whole = new Int16Array(buffer);
  const [runs, frames] = array.shape, [overFrames, overPoints] = array.orders;
  const wide = whole.length / (runs * frames) || 0;
  const values = new Float32Array(whole.length);
  for (let k = 0; k < whole.length; k++) whole[k] = ((whole[k] & 0xffff) >>> 1) ^ -(whole[k] & 1);
  for (let order = 0; order < overPoints; order++) {
    for (let from = 0; from < whole.length; from += wide) {
      for (let k = from + 2; k < from + wide; k++) whole[k] += whole[k - 2];
    }
  }
  for (let order = 0; order < overFrames; order++) {
    for (let run = 0; run < runs; run++) {
      for (let k = (run * frames + 1) * wide; k < (run + 1) * frames * wide; k++) whole[k] += whole[k - wide];
    }
  }
  const { offset: [x, y], scale } = array;
  for (let k = 0; k < whole.length; k += 2) {
    values[k] = whole[k] === -32768 ? NaN : x + scale * whole[k];
    values[k + 1] = whole[k + 1] === -32768 ? NaN : y + scale * whole[k + 1];
  }
  return { values, runs, frames, wide };
}

// Where a time is among ascending ones: the sample before it and the share of the way to the next.
function between(times, time) {
  let low = 0, high = times.length - 1;
  if (!(time > times[0])) return [0, 0];
  if (time >= times[high]) return [Math.max(0, high - 1), high > 0 ? 1 : 0];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  return [low, (time - times[low]) / (times[high] - times[low])];
}

// Values of an array (runs, frames, wide) at a time: between frames, as motion is; what stands still has one frame.
function valuesAt(array, run, before, share) {
  if (array.frames === 1) before = share = 0;
  const start = (run * array.frames + before) * array.wide;
  const out = array.values.slice(start, start + array.wide);
  if (share > 0) for (let k = 0; k < out.length; k++) out[k] += share * (array.values[start + array.wide + k] - out[k]);
  return out;
}

// The last frame a run got to.
function lastFrame(array, run) {
  for (let frame = array.frames - 1; frame >= 0; frame--) {
    const start = (run * array.frames + frame) * array.wide;
    for (let k = 0; k < array.wide; k++) if (Number.isFinite(array.values[start + k])) return frame;
  }
  return -1;
}
