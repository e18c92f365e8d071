// Reading the page's own data: arrays of meshes, and chunks of frames.

async function bytesOf(text) {
  return inflated(Uint8Array.from(atob(text), character => character.charCodeAt(0)));
}

async function inflated(raw) {
  if (!window.DecompressionStream) throw new Error("this browser is older than 2023");
  const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Takes typed arrays from bytes, one after the other; `take.planes` those whose low bytes all come
// first, then the higher ones.
function reader(bytes) {
  let at = 0;
  const take = (Type, count) => {
    const size = count * Type.BYTES_PER_ELEMENT;
    at += size;
    return new Type(bytes.slice(at - size, at).buffer);
  };
  take.planes = (Type, count) => {
    const size = Type.BYTES_PER_ELEMENT;
    const mixed = new Uint8Array(count * size);
    for (let plane = 0; plane < size; plane++)
      for (let i = 0; i < count; i++) mixed[i * size + plane] = bytes[at++];
    return new Type(mixed.buffer);
  };
  return take;
}

// Gives each part its points [m], directions, triangles F and texture coordinates of their corners.
function readArrays(parts, bytes) {
  const take = reader(bytes);
  for (const part of parts) {
    const places = take(Uint16Array, 3 * part.points);
    const directions = take(Int16Array, 3 * part.points);
    part.rest = Float32Array.from(places, (place, i) => part.low[i % 3] + (place / 65535) * part.size);
    part.directions = Float32Array.from(directions, value => value / 32767);
    part.F = take(Uint32Array, 3 * part.triangles);
    part.uv = part.textured ? take(Float32Array, 6 * part.triangles) : null;
  }
}

// Two earlier vertices from which each is predicted; page.py finds the same ones. The last entry
// stands for none.
function parentsOf(part) {
  const parents = new Int32Array(2 * part.points).fill(part.points);
  const second = new Uint8Array(part.points);
  const third = new Uint8Array(part.points);
  for (let t = 0; t < part.F.length; t += 3) {
    const [a, b, c] = part.F.slice(t, t + 3).sort();
    if (!third[c]) {
      third[c] = 1;
      parents[2 * c] = a;
      parents[2 * c + 1] = b;
    }
    if (!third[b] && !second[b]) {
      second[b] = 1;
      parents[2 * b] = parents[2 * b + 1] = a;
    }
  }
  return parents;
}

// The frames of the page, decoded chunk by chunk; the latest chunks are kept.
class Frames {
  constructor(meta, targets) {
    this.meta = meta;
    this.targets = targets;
    this.parents = targets.map(parentsOf);
    this.motions = new Map(); // of the targets that move, by their numbers
    this.kept = new Map();
    this.most = 24;
  }

  get count() {
    const end = document.getElementById("end");
    return end ? JSON.parse(end.textContent).frames : this.meta.chunk * this.tags.length;
  }

  get tags() {
    return document.querySelectorAll("script.chunk");
  }

  async load() {}

  get ended() {
    return Boolean(document.getElementById("end"));
  }

  async get(number) {
    const chunk = Math.floor(number / this.meta.chunk);
    if (!this.kept.has(chunk)) {
      this.kept.set(
        chunk,
        bytesOf(this.tags[chunk].textContent).then(bytes => this.decoded(bytes)),
      );
      if (this.kept.size > this.most) this.kept.delete(this.kept.keys().next().value);
    }
    return (await this.kept.get(chunk))[number % this.meta.chunk];
  }

  async motion(target) {
    if (!this.motions.has(target)) {
      const told = JSON.parse(document.querySelector(`script.motion[data-target="${target}"]`).textContent);
      this.motions.set(target, new Motion(this.targets[target], told, await bytesOf(told.arrays)));
    }
    return this.motions.get(target);
  }

  async decoded(bytes) {
    const size = new DataView(bytes.buffer).getUint32(0, true);
    const {poses, arrows, middles, waves} = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
    let at = 4 + size;
    // Whole steps: those before and what was left after prediction, in three planes of bytes.
    const next = (before, parents) => {
      const count = before.length;
      const change = new Int32Array(count + 1);
      const now = new Int32Array(count);
      for (let v = 0; v < count; v++) {
        const code = bytes[at + v] | (bytes[at + count + v] << 8) | (bytes[at + 2 * count + v] << 16);
        const left = code & 1 ? -((code + 1) >> 1) : code >> 1;
        change[v] = left + ((change[parents[2 * v]] + change[parents[2 * v + 1]]) >> 1);
        now[v] = before[v] + change[v];
      }
      at += 3 * count;
      return now;
    };
    // targets have their events, or else their heights in steps
    let before = this.targets.map((part, k) => (waves[k] ? null : new Int32Array(part.points)));
    const frames = poses.map((pose, i) => {
      before = before.map((last, k) => last && next(last, this.parents[k]));
      const events = this.targets.map((_, k) => (waves[k] ? waves[k][i] : null));
      return {pose, arrows: arrows[i], steps: before, events, vertices: []};
    });
    for (const [target, places] of Object.entries(middles)) {
      const {points, step, parents} = await this.motion(target);
      let axes = [0, 1, 2].map(() => new Int32Array(points));
      places.forEach((middle, i) => {
        axes = axes.map(last => next(last, parents));
        frames[i].vertices[target] = Float32Array.from(
          {length: 3 * points},
          (_, v) => middle[v % 3] + step * axes[v % 3][Math.floor(v / 3)],
        );
      });
    }
    return frames;
  }
}
