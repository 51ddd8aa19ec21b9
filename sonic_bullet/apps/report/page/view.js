// Looks of materials by a word of their name, linear light: told apart at a glance, no measured colours.
const TINTS = [
  [/brass|bronze/, [0.72, 0.5, 0.16]], [/copper/, [0.72, 0.28, 0.14]], [/alumin/, [0.82, 0.84, 0.87]], [/glass/, [0.55, 0.82, 0.78]],
  [/porcelain|ceramic|mug/, [0.96, 0.94, 0.88]], [/concrete/, [0.36, 0.35, 0.33]], [/wood|spruce/, [0.5, 0.29, 0.12]],
  [/plastic/, [0.2, 0.42, 0.75]], [/rubber/, [0.06, 0.06, 0.06]], [/steel|metal|iron/, [0.55, 0.58, 0.63]],
];

function tintOf(name) { return (TINTS.find(([word]) => word.test(name)) ?? [null, [0.93, 0.93, 0.93]])[1]; }

// The body in 3D: it is struck where it is pressed, turned beside it, and bends as a mode does.

const SHOWN_HZ = 0.7; // of a mode that is shown: slow enough to be followed
const SHOWN_PART = 0.08; // of the body's size, by which it is seen to move at most

// Purple – white – orange: one way, not at all, the other way [ColorBrewer PuOr, safe for all eyes], linear light.
function deflectionColour(x) {
  const to = x < 0 ? [0.11, 0.02, 0.33] : [0.79, 0.12, 0], t = Math.min(Math.abs(x), 1);
  return to.map(c => (1 - t) * 0.93 + t * c);
}

class View extends Stage {
  // on: {press(hit), drag(hit), release()}, hit: {point, corner, weight, normal, place}
  constructor(canvas, on) {
    super(canvas, 35, 0.001);
    Object.assign(this, { on, size: 1, tint: tintOf("") });
    this.marker.material.depthTest = false; // half of it is in the body
    this.marker.renderOrder = 1;
    this.ray = new THREE.Raycaster();
    canvas.addEventListener("pointerdown", event => this.down(event)); // before the camera's own: it is asked first
    canvas.addEventListener("pointermove", event => this.moved(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      canvas.addEventListener(end, () => this.up());
    }
    this.orbit();
    this.controls.enablePan = false;
    this.still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.draw = this.draw.bind(this);
    requestAnimationFrame(this.draw);
  }

  // A look, and how many times larger than baked it is.
  make(name, size) {
    this.tint = tintOf(name);
    this.size = size;
    if (this.mesh && this.mode === null) this.bend(0);
    this.stale = true;
  }

  show(body, mode = null) {
    if (this.body !== body) {
      const moved = !sameShape(this.body, body);
      if (this.mesh) { this.scene.remove(this.mesh); this.mesh.geometry.dispose(); }
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(body.point_m), 3));
      shape.setAttribute("color", new THREE.BufferAttribute(new Float32Array(body.point_m.length).fill(0.93), 3));
      shape.setIndex(new THREE.BufferAttribute(body.face, 1));
      const look = new THREE.MeshStandardMaterial({
        vertexColors: true, side: THREE.DoubleSide, flatShading: true, roughness: 0.55, metalness: 0.1 });
      this.mesh = new THREE.Mesh(shape, look);
      this.scene.add(this.mesh);
      this.body = body;
      if (moved) this.lookAt(body);
    }
    this.mode = mode;
    this.since = performance.now();
    this.bend(mode === null ? 0 : 1);
    this.stale = true;
  }

  lookAt(body) {
    this.marker.scale.setScalar(0.012 * body.size_m);
    const middle = body.low.map((l, x) => (l + body.high[x]) / 2),
      far = 1.5 * body.size_m * Math.max(1, 1.5 * this.canvas.clientHeight / (this.canvas.clientWidth || 1));
    this.controls.target.set(...middle);
    this.camera.position.set(middle[0] + 0.45 * far, middle[1] - 0.7 * far, middle[2] + 0.55 * far);
    this.camera.near = body.size_m / 100;
    this.camera.far = body.size_m * 100;
    this.controls.minDistance = 0.6 * body.size_m;
    this.controls.maxDistance = 10 * body.size_m;
    this.controls.update();
    this.camera.updateProjectionMatrix();
  }

  // A mark at a place, which moves as its nearest point does.
  mark(place, point) {
    super.mark(place);
    this.marked = place && { place, point };
  }

  // The shape of the shown mode, at a phase whose sine is given; colours: along the normal, of the largest.
  bend(phase) {
    const { body, mesh, mode } = this, position = mesh.geometry.attributes.position, colour = mesh.geometry.attributes.color;
    const n = body.point_count, from = mode === null ? 0 : 3 * mode * n;
    let most = 1e-30;
    if (mode !== null) for (let i = 0; i < 3 * n; i += 3) {
      most = Math.max(most, Math.hypot(body.shape[from + i], body.shape[from + i + 1], body.shape[from + i + 2]));
    }
    const scale = mode === null ? 0 : phase * SHOWN_PART * body.size_m / most;
    for (let p = 0; p < n; p++) {
      let along = 0, square = 0;
      for (let x = 0; x < 3; x++) {
        const i = 3 * p + x, u = mode === null ? 0 : body.shape[from + i];
        position.array[i] = body.point_m[i] + scale * u;
        along += u * body.normal[i];
        square += u * u;
      }
      colour.array.set(mode === null ? this.tint : deflectionColour(Math.sign(along) * Math.sqrt(square) / most), 3 * p);
    }
    if (this.marked) {
      const from_p = from + 3 * this.marked.point;
      this.marker.position.set(...this.marked.place.map((x, i) => x + (mode === null ? 0 : scale * body.shape[from_p + i])));
    }
    position.needsUpdate = colour.needsUpdate = true;
    this.stale = true;
  }

  hit(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = 2 * (event.clientX - box.left) / box.width - 1, y = 1 - 2 * (event.clientY - box.top) / box.height;
    this.ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
    if (this.mode !== null) this.bend(0); // struck at rest
    this.mesh.geometry.computeBoundingSphere();
    const [found] = this.ray.intersectObject(this.mesh);
    if (!found) return null;
    const { a, b, c, normal } = found.face;
    const corner = [a, b, c], outward = normal.dot(this.ray.ray.direction) > 0 ? normal.clone().negate() : normal;
    const weight = barycentric(found.point.toArray(), corner.map(p => at(this.body.point_m, p)));
    const point = corner[weight.indexOf(Math.max(...weight))];
    return { point, corner, weight, normal: outward.toArray(), place: found.point.toArray() };
  }

  // Looks for the surface once before anybody presses: the first time a browser compiles it, which takes 7 ms of 8.
  hitMiddle() {
    const box = this.canvas.getBoundingClientRect();
    this.hit({ clientX: box.left + box.width / 2, clientY: box.top + box.height / 2 });
  }

  down(event) {
    if (event.button || this.held || !this.mesh) return;
    const hit = this.hit(event);
    if (!hit) return;
    this.held = true;
    this.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    this.on.press(hit, event);
  }

  moved(event) {
    if (!this.held) return;
    const hit = this.hit(event);
    if (hit) this.on.drag(hit, event);
  }

  up() {
    if (!this.held) return;
    this.held = false;
    this.controls.enabled = true;
    this.on.release();
  }

  // Right and up of the screen, as directions of the body.
  axes() {
    const e = this.camera.matrixWorld.elements;
    return { right: [e[0], e[1], e[2]], up: [e[4], e[5], e[6]] };
  }

  // A length in m that is 0.15 to 0.4 of the picture's height at the body, a 1, 2 or 5 of its decade, and its pixels.
  scaleBar() {
    const far = this.camera.position.distanceTo(this.controls.target);
    const px_m = this.canvas.clientHeight / (2 * far * Math.tan(this.camera.fov * Math.PI / 360)) / this.size;
    const most = 0.4 * this.canvas.clientHeight / px_m, decade = 10 ** Math.floor(Math.log10(most));
    const length_m = decade * [5, 2, 1].find(x => x * decade <= most);
    return { length_m, px: length_m * px_m };
  }

  draw(now) {
    if (this.mode !== null && this.mode !== undefined && !this.still && !this.held) {
      this.bend(Math.cos(2 * Math.PI * SHOWN_HZ * (now - this.since) / 1000));
    }
    const { stale } = this;
    super.draw();
    if (stale) this.on.seen(); // the camera knows its axes once it has drawn
    requestAnimationFrame(this.draw);
  }
}

// Weights of the corners of a triangle at a place in it.
function barycentric(place, [a, b, c]) {
  const minus = (u, v) => u.map((x, i) => x - v[i]), dot = (u, v) => u.reduce((s, x, i) => s + x * v[i], 0);
  const u = minus(b, a), v = minus(c, a), w = minus(place, a);
  const uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v), whole = uu * vv - uv * uv;
  const one = (vv * wu - uv * wv) / whole, two = (uu * wv - uv * wu) / whole;
  return [1 - one - two, one, two].map(x => Math.min(Math.max(x, 0), 1));
}
