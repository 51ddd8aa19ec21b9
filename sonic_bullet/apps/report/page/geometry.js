// A body's numbers as arrays, and what is asked of its surface.

const ARRAYS = { f4: Float32Array, f8: Float64Array, u4: Uint32Array, i2: Int16Array };

// {type, base64} -> typed array, as page_data.py encoded it.
function decodeArray({ type, base64 }) {
  const bytes = Uint8Array.from(atob(base64), c => c.charCodeAt(0));
  return new ARRAYS[type](bytes.buffer);
}

function decodeAll(record) {
  const made = {};
  for (const [name, value] of Object.entries(record)) made[name] = value?.base64 ? decodeArray(value) : value;
  return made;
}

function decodeBody(data) {
  const body = decodeAll(data);
  const each = 3 * body.point_count;
  body.shape = Float32Array.from(body.shape, (value, i) => value * body.shape_step[Math.floor(i / each)]);
  body.materials = data.materials.map(decodeAll);
  if (body.residual) body.residual = decodeAll(body.residual);
  body.low = [0, 1, 2].map(x => extreme(body.point_m, x, Math.min));
  body.high = [0, 1, 2].map(x => extreme(body.point_m, x, Math.max));
  body.size_m = Math.hypot(...body.high.map((h, x) => h - body.low[x]));
  body.neighbours = neighboursOf(body);
  body.ends = endsInWords(body);
  return body;
}

// Whether two bodies are one shape in another state, such as before a fit and after it.
function sameShape(one, other) {
  return one?.point_count === other.point_count && one.point_m.every((x, i) => x === other.point_m[i]);
}

function extreme(values, offset, choose) {
  let best = values[offset];
  for (let i = offset; i < values.length; i += 3) best = choose(best, values[i]);
  return best;
}

// Points that share an edge with each point; points at one place share theirs.
function neighboursOf({ face, point_m, point_count }) {
  const first = new Map(), same = new Uint32Array(point_count);
  for (let p = 0; p < point_count; p++) {
    const key = point_m.slice(3 * p, 3 * p + 3).join();
    if (!first.has(key)) first.set(key, p);
    same[p] = first.get(key);
  }
  const near = Array.from({ length: point_count }, () => new Set());
  for (let i = 0; i < face.length; i += 3) {
    for (let c = 0; c < 3; c++) {
      const a = same[face[i + c]], b = same[face[i + (c + 1) % 3]];
      if (a !== b) { near[a].add(b); near[b].add(a); }
    }
  }
  for (let p = 0; p < point_count; p++) near[p] = near[same[p]];
  return near;
}

function at(values, p) { return [values[3 * p], values[3 * p + 1], values[3 * p + 2]]; }

// Names of the ends of the two level axes as they are seen, x and y to the right of the screen or into it.
function levelEndsInWords({ right }) {
  return [0, 1].map(x => {
    const into = x ? right[0] : -right[1]; // a camera is upright, so it looks along z cross right
    if (Math.abs(right[x]) > Math.abs(into)) return right[x] > 0 ? ["left", "right"] : ["right", "left"];
    return into > 0 ? ["front", "back"] : ["back", "front"];
  });
}

// Names of the ends of each axis. An end is a rim where nothing of that quarter of the height is near the axis.
function endsInWords({ low, high, point_m }) {
  const nearest = [Infinity, Infinity];
  for (let i = 0; i < point_m.length; i += 3) {
    const [x, y, z] = [0, 1, 2].map(k => 2 * (point_m[i + k] - low[k]) / (high[k] - low[k] || 1) - 1); // -1 to 1
    if (Math.abs(z) > 0.5) nearest[+(z > 0)] = Math.min(nearest[+(z > 0)], Math.hypot(x, y));
  }
  const [below, above] = nearest.map(r => r > 0.5);
  const upright = below && above ? ["lower rim", "upper rim"] : [below ? "rim" : "bottom", above ? "rim" : "top"];
  return [["left", "right"], ["front", "back"], upright];
}

// Where on the body a place is, in words: "top, left", "middle".
function placeInWords(body, place) {
  const words = [2, 0, 1].map(x => {
    const length = body.high[x] - body.low[x];
    if (length < 0.05 * body.size_m) return ""; // a thin body has no top there
    const part = (place[x] - body.low[x]) / length;
    return part < 0.2 ? body.ends[x][0] : part > 0.8 ? body.ends[x][1] : "";
  }).filter(Boolean);
  return words.length ? words.join(", ") : "middle";
}

// Where a mode moves most, in words: the quarter at an end of an axis that has more of Σ|φ|² than all the rest.
function mostMovedInWords(body, mode) {
  const share = [0, 1, 2].map(() => [0, 0, 0]);
  let whole = 0;
  for (let p = 0; p < body.point_count; p++) {
    const i = 3 * (mode * body.point_count + p);
    const square = body.shape[i] ** 2 + body.shape[i + 1] ** 2 + body.shape[i + 2] ** 2;
    whole += square;
    for (let x = 0; x < 3; x++) {
      const length = body.high[x] - body.low[x];
      const part = length > 0.05 * body.size_m ? (body.point_m[3 * p + x] - body.low[x]) / length : 0.5;
      share[x][part < 0.25 ? 0 : part > 0.75 ? 2 : 1] += square;
    }
  }
  const said = [];
  for (const x of [2, 0, 1]) {
    const [low, , high] = share[x].map(s => s / whole), [first, last] = body.ends[x];
    if (high > 0.5) said.push(last);
    else if (low > 0.5) said.push(first);
    else if (low + high > 0.75 && low > 0.25 && high > 0.25) said.push(`${first} and ${last}`);
  }
  return said.length ? said.join(", ") : "all over";
}

// The neighbour of a point that lies most along a direction; the point itself where none does.
function neighbourAlong(body, point, direction) {
  const here = at(body.point_m, point);
  let best = point, most = 0.2;
  for (const next of body.neighbours[point]) {
    const way = at(body.point_m, next).map((v, x) => v - here[x]);
    const along = way.reduce((sum, v, x) => sum + v * direction[x], 0) / Math.hypot(...way);
    if (along > most) [best, most] = [next, along];
  }
  return best;
}
