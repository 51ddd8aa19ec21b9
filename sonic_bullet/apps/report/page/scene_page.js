// A scene's motion with its sound in step: one clock, that of the sound, and the picture asks it.

const FAINT_DB = 50; // below the loudest event a mark is as pale as marks become
const NEAR_PX = 24; // of a finger's width [WCAG 2.2, 2.5.8]
const SHORT_S = 0.02, AFTER_S = 0.8; // before an event that is heard alone, and after it, where it fades
const NAMED_S = 0.3; // that an impact is named for while all plays: as long as the eye rests on a word, at most [Rayner 1998]

const scene = JSON.parse(document.getElementById("data").textContent);

// Meshes at poses: between two pictures on the line, and on the shorter arc.
class SceneView extends Stage {
  constructor(canvas, data) {
    super(canvas, data.view_deg, 0.01);
    this.data = data;
    this.camera.position.set(...data.eye_m);
    this.meshes = data.meshes.map(one => this.add(one));
    this.marker.scale.setScalar(0.006 * Math.hypot(...data.eye_m.map((x, i) => x - data.target_m[i])));
    this.marker.visible = this.marker.material.depthTest = false; // where two bodies touch, it lies between them
    this.marker.renderOrder = 1;
    this.orbit();
    this.controls.target.set(...data.target_m);
    this.controls.update();
  }

  add(one) {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(one.vertex_m, 3));
    shape.setIndex(new THREE.BufferAttribute(one.face, 1));
    const look = new THREE.MeshStandardMaterial({
      color: new THREE.Color(...one.colour), side: THREE.DoubleSide, flatShading: true, roughness: 0.6 });
    const mesh = new THREE.Mesh(shape, look);
    this.scene.add(mesh);
    return mesh;
  }

  at(time_s) {
    const { pictures, fps } = this.data, place = Math.min(Math.max(time_s * fps, 0), pictures - 1);
    const first = Math.floor(place), part = place - first, next = Math.min(first + 1, pictures - 1);
    this.meshes.forEach((mesh, i) => {
      const { pose, shown } = this.data.meshes[i], still = pose.length === 7;
      const a = still ? 0 : 7 * first, b = still ? 0 : 7 * next;
      mesh.visible = shown.length === 1 ? !!shown[0] : !!shown[first];
      mesh.position.set(...[0, 1, 2].map(x => pose[a + x] + part * (pose[b + x] - pose[a + x])));
      mesh.quaternion.set(...pose.subarray(a + 3, a + 7)).slerp(new THREE.Quaternion(...pose.subarray(b + 3, b + 7)), part);
    });
    this.stale = true;
  }
}

// Sounds of the bodies, started together: their sum is the mix.
class Player {
  constructor(data) {
    this.data = data;
    this.from = 0;
    this.began = null;
    this.until = data.seconds;
    this.slow = 1;
    this.sources = [];
    this.asked = 0; // how often something was to play, or to stop
  }

  // All that takes time before the first sound, but for the loudspeaker, which a browser opens once a page is touched.
  prepare() { return this.opening ??= this.make(); }

  async open() {
    await this.prepare();
    await this.context.resume();
  }

  async make() {
    this.context = new AudioContext({ sampleRate: this.data.sr });
    this.output = this.context.createGain();
    this.output.connect(this.context.destination);
    this.buffers = await Promise.all(this.data.stems.map(stem => this.context.decodeAudioData(bytesOf(stem.flac).buffer)));
  }

  now() {
    if (this.began === null) return this.from;
    const played = this.context.currentTime - (this.context.outputLatency || 0) - this.began;
    return Math.min(this.from + Math.max(0, played) / this.slow, this.until);
  }

  // Plays from a time to another: all bodies, or those of one event, whose end the picture does not pass while they ring on.
  async play(from = this.from, until = this.data.seconds, alone = null) {
    this.stop();
    const asked = ++this.asked;
    await this.open();
    if (asked !== this.asked) return; // somebody asked for something else, or to stop, before the sound was open
    const begins = this.context.currentTime + 0.02, length = (until - from) * this.slow;
    this.data.stems.forEach((stem, i) => {
      if (alone && stem.body !== alone.low && stem.body !== alone.high) return;
      const source = this.context.createBufferSource(), level = this.context.createGain();
      source.buffer = this.buffers[i];
      source.playbackRate.value = 1 / this.slow;
      level.gain.value = stem.gain;
      if (alone) {
        const fade = Math.min(0.3, length / 2);
        level.gain.setValueAtTime(0, begins);
        level.gain.linearRampToValueAtTime(stem.gain, begins + 0.005);
        level.gain.setValueAtTime(stem.gain, begins + length - fade);
        level.gain.linearRampToValueAtTime(0, begins + length);
      }
      source.connect(level).connect(this.output);
      source.start(begins, from, until - from);
      this.sources.push(source);
    });
    const last = !alone ? until : alone.kind === "impact" ? alone.start_s : alone.end_s; // seen
    Object.assign(this, { from, until, began: begins, alone, last, after: alone ? alone.start_s : until });
  }

  // The time that is seen.
  seen() { return this.began === null ? this.from : Math.min(this.now(), this.last); }

  stop() {
    this.asked += 1;
    this.from = this.seen();
    this.began = null;
    this.sources.forEach(one => one.stop());
    this.sources = [];
  }
}

function bytesOf(base64) { return Uint8Array.from(atob(base64), c => c.charCodeAt(0)); }

(function start() {
  const byId = id => document.getElementById(id), slide = byId("time");
  scene.meshes = scene.meshes.map(decodeAll);
  const player = new Player(scene);
  let view = null, marked = [], chosen = null, followed = null, rank = -1;
  try { view = new SceneView(byId("view"), scene); } catch (error) { byId("no-view").hidden = false; }
  slide.max = Math.round(1000 * scene.seconds); // whole ms, which are read out as they are
  scene.events.sort((a, b) => a.start_s - b.start_s);
  byId("notes").replaceChildren(...scene.notes.map(note => Object.assign(document.createElement("li"), { textContent: note })));

  function eventWords(one) {
    const who = `${scene.bodies[one.low]} and ${scene.bodies[one.high]}`;
    const impact = one.kind === "impact"; // without approach: what a struck neighbour transmits [load_splitting.hpp]
    const how = one.speed_m_s > 0 ? `${one.speed_m_s.toPrecision(2)} m/s` : "a neighbour's blow goes through";
    const level = one.level_db === null ? "" : `, ${one.level_db.toFixed(0)} dB SPL${impact ? " peak" : ""} at ${one.distance_m.toPrecision(2)} m`;
    const when = impact ? one.start_s.toFixed(3) : `${one.start_s.toFixed(3)} to ${one.end_s.toFixed(3)}`;
    return `${one.kind}: ${who}, ${when} s, ${how}${level}`;
  }

  // Seconds below the lanes, at most eight.
  function timeAxis() {
    const axis = Object.assign(document.createElement("div"), { className: "axis" });
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find(one => scene.seconds / one <= 8) ?? scene.seconds;
    for (let i = 0; i * step < scene.seconds - step / 2; i++) {
      const tick = Object.assign(document.createElement("span"), { textContent: `${+(i * step).toFixed(1)} s` });
      tick.style.left = `${100 * i * step / scene.seconds}%`;
      axis.append(tick);
    }
    return axis;
  }

  // Marks events, each in the lanes of both its bodies.
  function choose(events) {
    for (const one of marked) if (!events.includes(one)) one.marks.forEach(mark => mark.removeAttribute("aria-current"));
    for (const one of events) one.marks.forEach(mark => mark.setAttribute("aria-current", "true"));
    marked = events;
  }

  function say(one, live = "polite") {
    byId("said").setAttribute("aria-live", live);
    byId("said").textContent = one ? eventWords(one) : "";
    byId("loudest").textContent = one && one === ranked[rank] && one === chosen ? "Next loudest" : "Loudest";
    view?.mark(one?.place_m ?? null);
  }

  // While all plays: marks what sounds now, and names the loudest; not aloud, for it is the scene that is listened to.
  function follow(time) {
    const named_s = NAMED_S / player.slow;
    const now = scene.events.filter(e => e.start_s <= time && time < (e.kind === "impact" ? e.start_s + named_s : e.end_s));
    choose(now);
    const impacts = now.filter(e => e.kind === "impact"), one = loudestOf(impacts.length ? impacts : now);
    if (one !== followed) say(one, "off");
    followed = one;
  }

  function loudestOf(events) { return events.reduce((best, e) => best && best.level_db >= e.level_db ? best : e, null); }

  async function hear(one) {
    chosen = followed = one;
    choose([one]);
    say(one);
    await player.play(Math.max(one.start_s - SHORT_S, 0), Math.min(one.end_s + one.late_s + AFTER_S, scene.seconds), one);
    show();
  }

  const ranked = [...scene.events].sort((a, b) => b.level_db - a.level_db), loudest_db = ranked[0]?.level_db ?? 0;
  for (const one of scene.events) one.marks = [];
  const lanes = scene.stems.map(stem => stem.body);
  byId("lanes").replaceChildren(...lanes.flatMap(body => {
    const name = Object.assign(document.createElement("div"), { className: "name", textContent: scene.bodies[body] });
    const lane = Object.assign(document.createElement("div"), { className: "lane" });
    lane.setAttribute("role", "group");
    lane.setAttribute("aria-label", `Events of ${scene.bodies[body]}`);
    const own = scene.events.filter(e => e.low === body || e.high === body);
    const marks = own.map(() => document.createElement("button"));
    lane.addEventListener("keydown", event => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (step) marks[marks.indexOf(event.target) + step]?.focus();
    });
    lane.addEventListener("click", event => { // beside a mark: the nearest is meant
      if (event.target !== lane) return;
      const far = marks.map(mark => (box => Math.max(box.left - event.clientX, event.clientX - box.right))(mark.getBoundingClientRect()));
      const nearest = far.indexOf(Math.min(...far));
      if (far[nearest] < NEAR_PX) marks[nearest].click();
    });
    for (const one of [...own.filter(e => e.kind !== "impact"), ...own.filter(e => e.kind === "impact")]) { // on top
      const number = own.indexOf(one), mark = marks[number];
      mark.type = "button";
      mark.tabIndex = number ? -1 : 0;
      mark.title = eventWords(one);
      one.marks.push(mark);
      mark.style.left = `${100 * one.start_s / scene.seconds}%`;
      if (one.kind !== "impact") {
        mark.className = "span";
        mark.style.width = `${100 * (one.end_s - one.start_s) / scene.seconds}%`;
      } else mark.style.opacity = Math.max(1 - (loudest_db - (one.level_db ?? 0)) / FAINT_DB, 0.25);
      mark.addEventListener("click", () => hear(one));
      lane.append(mark);
    }
    return [name, lane];
  }), document.createElement("div"), timeAxis(), Object.assign(document.createElement("div"), { id: "head" }));

  function leave() {
    chosen = followed = null;
    choose([]);
    say(null);
  }

  function toggle() {
    leave();
    if (player.began !== null) player.stop();
    else player.play(player.from >= scene.seconds - 0.01 ? 0 : player.from);
  }

  function show() {
    const time = player.seen();
    slide.value = Math.round(1000 * time);
    slide.setAttribute("aria-valuetext", `${time.toFixed(3)} s`);
    byId("head").style.left = `calc((var(--names) + 0.6rem) * ${1 - time / scene.seconds} + 100% * ${time / scene.seconds})`; // page.css
    byId("clock").value = `${time.toFixed(3)} s`;
    byId("play").textContent = player.began === null ? "Play" : "Stop";
    view?.at(time);
  }

  byId("play").addEventListener("click", () => { toggle(); show(); });
  slide.addEventListener("input", () => { player.stop(); player.from = slide.value / 1000; leave(); show(); });
  // By buttons: an event by time from the chosen one on, or else from the clock.
  function go(one) {
    if (!one) return;
    hear(one);
    one.marks[0]?.scrollIntoView({ block: "nearest" });
  }
  const at = scene.events.indexOf.bind(scene.events);
  byId("previous").addEventListener("click", () =>
    go(chosen ? scene.events[at(chosen) - 1] : scene.events.findLast(e => e.start_s < player.seen())));
  byId("next").addEventListener("click", () =>
    go(chosen ? scene.events[at(chosen) + 1] : scene.events.find(e => e.start_s >= player.seen())));
  byId("loudest").addEventListener("click", () => {
    rank = chosen !== null && chosen === ranked[rank] ? (rank + 1) % ranked.length : 0;
    go(ranked[rank]);
  });
  byId("slow").addEventListener("change", () => { player.stop(); player.slow = +byId("slow").value; show(); });
  document.addEventListener("keydown", event => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey || ["SELECT", "INPUT"].includes(event.target.tagName)) return;
    if (key === " " && event.target.tagName !== "BUTTON") { toggle(); event.preventDefault(); }
    else if ("wasd".includes(key)) view?.turn(key === "a" ? -0.2 : key === "d" ? 0.2 : 0, key === "w" ? 0.2 : key === "s" ? -0.2 : 0);
  });

  function tick() {
    if (player.began !== null) {
      if (player.now() >= player.until) {
        player.stop();
        player.from = player.after;
        if (!player.alone) leave();
      } else if (!player.alone) follow(player.seen());
      show();
    }
    view?.draw();
    requestAnimationFrame(tick);
  }
  show();
  requestAnimationFrame(tick);
  requestAnimationFrame(() => setTimeout(() => player.prepare(), 0)); // once the page is seen
  Object.assign(scene, { player, view, hear });
})();
