// The page of struck bodies: controls -> modes of that material and size -> bank; hits -> strikes, scrapes.

const TOOL = { radius_m: 1e-3, load_n: 0.5, modulus_pa: 1.1e11, spacing_m: 1e-5 }; // a steel point that scrapes
const FALL_60_DB = Math.log(1000); // in e^{-dt}

const page = JSON.parse(document.getElementById("data").textContent);
page.bodies = page.bodies.map(decodeBody);
page.recordings = page.recordings.map(decodeAll);

(function start() {
  const byId = id => document.getElementById(id), controls = byId("controls").elements;
  const sound = new Sound(1);
  let body, modes, view, point, shown = null, levels = null, heard = null, before = null, lastStrike = null, told = "", scraping = false;

  function chooseBody(number) {
    const was = body;
    body = page.bodies[number];
    byId("name").textContent = body.name;
    controls.material.closest("label").hidden = body.materials.length < 2;
    controls.material.replaceChildren(...body.materials.map((one, i) => new Option(one.name, i)));
    byId("notes").replaceChildren(...body.notes.map(note => Object.assign(document.createElement("li"), { textContent: note })));
    const moved = !sameShape(was, body); // else it is another state of one body, struck at the same place as loud
    if (moved) {
      sound.fullScalePa = body.tap.peak_pa / 0.35;
      controls.strength.value = Math.log10(body.tap.impulse_n_s);
    }
    shown = levels = heard = lastStrike = null;
    change();
    listModes();
    view?.show(body, null);
    turned();
    if (moved) moveTo(body.tap.point);
  }

  // Controls as numbers.
  function settings() {
    return {
      material: +controls.material.value, size: 2 ** controls.size.value, contact_s: 1e-3 * 10 ** controls.hammer.value,
      impulse_n_s: 10 ** controls.strength.value, distance_m: 10 ** controls.distance.value, volume_db: +controls.volume.value,
    };
  }

  function change() {
    const now = settings(), ms = 1e3 * now.contact_s;
    const tool = ms < 0.15 ? "steel" : ms < 0.5 ? "wood" : ms < 2 ? "hard rubber" : "felt";
    const said = {
      size: `× ${now.size.toPrecision(3)}`, hammer: `${tool}, ${ms.toPrecision(2)} ms`,
      strength: `${+(1e3 * now.impulse_n_s).toPrecision(2)} g at 1 m/s`, distance: `${now.distance_m.toPrecision(2)} m`,
      volume: `${now.volume_db} dB`,
    };
    for (const [name, text] of Object.entries(said)) {
      controls[name + "_said"].value = text;
      controls[name].setAttribute("aria-valuetext", text);
    }
    modes = modesOf(body, now.material, now.size);
    sound.distance_m = now.distance_m;
    sound.volume_db = now.volume_db;
    sound.place();
    sound.setModes(modes);
    view?.make(body.materials[now.material].name, now.size);
    const mass = body.mass_kg ? `, ${(body.mass_kg * now.size ** 3 / body.materials[now.material].shape_factor ** 2).toPrecision(3)} kg` : "";
    byId("made").textContent = `${body.materials[now.material].name}${mass}, ${body.mode_count} modes`;
    byId("modes").querySelectorAll("tr").forEach(describe);
    showLevels();
    if (told !== `${now.material} ${now.size}`) say(shown === null ? "" : shapeInWords(shown)); // else it names old pitches
    told = `${now.material} ${now.size}`;
  }

  // The body was turned, or drawn larger: its sides have the names that they have on the screen.
  function turned() {
    if (!view?.body) return;
    const { length_m, px } = view.scaleBar(), ends = levelEndsInWords(view.axes());
    byId("scale").textContent = length_m < 1 ? `${+(100 * length_m).toPrecision(1)} cm` : `${length_m} m`;
    byId("scale").style.width = `${px}px`;
    if (ends.join() === body.ends.slice(0, 2).join()) return;
    body.ends.splice(0, 2, ...ends);
    for (const row of byId("modes").rows) row.cells[3].textContent = mostMovedInWords(body, +row.dataset.mode);
  }

  function listModes() {
    const order = Array.from(modes.freq_hz.keys()).sort((a, b) => modes.freq_hz[a] - modes.freq_hz[b]);
    byId("modes").replaceChildren(...order.map((mode, i) => {
      const row = document.createElement("tr");
      row.dataset.mode = mode;
      row.innerHTML = "<td></td><td></td><td></td><td></td><td><meter min=0 max=40></meter></td><td><button type=button>see</button> <button type=button>hear</button></td>";
      row.dataset.number = row.cells[0].textContent = i + 1;
      row.cells[3].textContent = mostMovedInWords(body, mode);
      const [see, hear] = row.querySelectorAll("button");
      see.addEventListener("click", () => show(shown === mode ? null : mode));
      hear.addEventListener("click", () => hearAlone(mode));
      describe(row);
      return row;
    }));
    enter(byId("modes").rows[0]);
  }

  // The list is one stop of the Tab key, at the row where it was left.
  function enter(row) {
    for (const button of byId("modes").querySelectorAll("button")) button.tabIndex = row.contains(button) ? 0 : -1;
  }

  function describe(row) {
    const mode = +row.dataset.mode, f = modes.freq_hz[mode], s = FALL_60_DB / modes.decay_per_s[mode];
    const pitch = `${f < 9999.5 ? f.toFixed(0) : (f / 1000).toFixed(1) + "k"} Hz`;
    row.cells[1].textContent = pitch;
    row.cells[2].textContent = s >= 1 ? `${s.toFixed(s < 10 ? 1 : 0)} s` : `${(1000 * s).toFixed(0)} ms`;
    const [see, hear] = row.querySelectorAll("button");
    see.setAttribute("aria-label", `See mode ${row.dataset.number}, ${pitch}`);
    hear.setAttribute("aria-label", `Hear mode ${row.dataset.number}, ${pitch}, alone`);
    see.setAttribute("aria-pressed", shown === mode);
  }

  // How loud each mode was in the last strike: bars from 40 dB below the loudest on.
  function showLevels() {
    if (!levels) return;
    const most = Math.max(...heard);
    for (const row of byId("modes").rows) {
      const below_db = 10 * Math.log10(most / Math.max(heard[row.dataset.mode], 1e-30)), meter = row.querySelector("meter");
      meter.value = most > 0 ? 40 - below_db : 0;
      meter.setAttribute("aria-label", "Level");
      meter.setAttribute("aria-valuetext", most > 0 ? `${below_db.toFixed(0)} dB below the loudest` : "silent");
    }
    plots.setMarks(Array.from(modes.freq_hz, (f, m) => [f, decibels(levels[m] / sound.distance_m)]));
  }

  function show(mode) {
    shown = mode;
    view?.show(body, mode);
    for (const row of byId("modes").rows) {
      row.setAttribute("aria-current", +row.dataset.mode === mode);
      describe(row);
      if (+row.dataset.mode === mode) byId("list").scrollTop = row.offsetTop - byId("list").clientHeight / 2;
    }
    say(mode === null ? "" : shapeInWords(mode));
  }

  function shapeInWords(mode) { return `Mode of ${modes.freq_hz[mode].toFixed(0)} Hz moves most at: ${mostMovedInWords(body, mode)}`; }

  function silence() {
    sound.silence();
    if (levels) levels.fill(0), heard.fill(0);
    showLevels();
    say(shown === null ? "Silenced" : `Silenced. ${shapeInWords(shown)}`);
  }

  function say(words) { byId("said").textContent = words; }

  function moveTo(next) {
    point = next;
    view?.mark(at(body.point_m, next), next);
  }

  function hitAtPoint() {
    return { point, corner: [point], weight: [1], normal: at(body.normal, point), place: at(body.point_m, point) };
  }

  // A strike into the surface. only: of one mode; asked_ms: when. The sound is ordered first, then told and drawn.
  function strike(hit, only = null, pressure = 0.5, asked_ms = performance.now()) {
    const { impulse_n_s, contact_s, size } = settings(), impulse = impulse_n_s * 2 * pressure;
    let gain = gainAt(body, modes, hit, hit.normal).map((g, m) => only === null || m === only ? -g * impulse : 0);
    levels = levelsOf(modes, gain, contact_s);
    const clip = only === null ? body.residual : null;
    let clipGain = clip ? Math.hypot(...levels) / clip.modal_level_pa : 0, energy = null;
    function listen() {
      const modal = heardEnergy(modes, gain, contact_s, page.heard_s, page.k_weighting);
      heard = modal.own;
      energy = modal.energy + (clip ? clipGain ** 2 * clip.energy : 0);
    }
    if (byId("equal").checked) {
      listen();
      const louder = energy > 0 ? Math.sqrt(page.tap_energy / energy) : 1;
      [gain, levels] = [gain, levels].map(all => all.map(x => x * louder));
      [clipGain, energy] = [clipGain * louder, energy * louder ** 2];
    }
    const play = () => sound.strike(gain, contact_s, clip, clipGain), ready = sound.bank;
    if (ready) play();
    const computed_ms = performance.now() - asked_ms;
    sound.open().then(() => ready || play()).catch(error => say(`No sound: ${error.message}`));
    if (energy === null) listen();
    lastStrike = { gain, contact_s, hit, size, energy, computed_ms };
    showLevels();
    const loudest = Array.from(heard.keys()).filter(m => modes.freq_hz[m] < 20000).sort((a, b) => heard[b] - heard[a]);
    const pitches = [...new Set(loudest.map(m => `${modes.freq_hz[m].toFixed(0)} Hz`))].slice(0, 3).join(", "); // twins once
    say(`Struck at ${placeInWords(body, hit.place)}: loudest ${pitches}`);
    byId("spectrum").setAttribute("aria-label", `Spectrum of the sound; loudest of the last strike: ${pitches}`);
  }

  // A mode alone, at the point where it moves most, which is marked; what rang before is silenced.
  function hearAlone(mode) {
    let best = 0, most = -1;
    for (let p = 0; p < body.point_count; p++) {
      const i = 3 * (mode * body.point_count + p);
      const along = Math.abs(body.shape[i] * body.normal[3 * p] + body.shape[i + 1] * body.normal[3 * p + 1] + body.shape[i + 2] * body.normal[3 * p + 2]);
      if (along > most) [best, most] = [p, along];
    }
    moveTo(best);
    sound.silence();
    strike(hitAtPoint(), mode);
    say(`Mode of ${modes.freq_hz[mode].toFixed(0)} Hz alone, struck where it moves most: ${placeInWords(body, at(body.point_m, best))}`);
  }

  // A recording as loud as the last strike.
  async function playRecording(clip) {
    if (!lastStrike) strike(hitAtPoint());
    await sound.open();
    const gain = Math.sqrt(lastStrike.energy / Math.max(clip.energy, 1e-12));
    sound.play(clip, gain);
    page.lastRecording = { name: clip.name, gain };
    say(`Recording ${clip.name}, as loud as the last strike`);
  }

  // A body struck where and how it was for a recording.
  function strikeAsRecorded(number, { point: place, direction }) {
    controls.body.value = number;
    if (body !== page.bodies[number]) chooseBody(number);
    moveTo(place);
    strike({ ...hitAtPoint(), normal: direction.map(x => -x) });
  }

  function scrape(hit) {
    if (before) {
      const way = Math.hypot(...hit.place.map((x, i) => x - before.place[i])), s = (performance.now() - before.at) / 1000;
      if (s < 0.008) return;
      const side = body.materials[settings().material].contact_modulus_pa ?? TOOL.modulus_pa;
      const shared = 1 / (1 / side + 1 / TOOL.modulus_pa); // E* [Johnson 1985, eq. 4.24]
      const stiffness = Math.cbrt(6 * TOOL.load_n * TOOL.radius_m * shared ** 2); // dF/dx of Hertz's law at the load
      const surface = { ...TOOL, stiffness_n_m: stiffness, roughness_m: body.roughness_m, hurst: body.hurst };
      if (!scraping) say(`Scraping at ${placeInWords(body, hit.place)}`);
      scraping = true;
      sound.open();
      sound.scrape(gainAt(body, modes, hit, hit.normal), Math.min(way / s, 2), surface);
      clearTimeout(scrape.still);
      scrape.still = setTimeout(() => sound.scrape(null), 120); // a point that rests makes no sound
    }
    before = { place: hit.place, at: performance.now() };
  }

  function endScrape() { before = null; scraping = false; sound.scrape(null); }

  const plots = new Plots(byId("spectrum"), byId("history"), byId("level"), byId("pitches"));
  const on = {
    press(hit, event) {
      moveTo(hit.point);
      view.mark(hit.place, hit.point);
      strike(hit, null, event.pointerType === "pen" && event.pressure ? event.pressure : 0.5, event.timeStamp);
      before = { place: hit.place, at: performance.now() };
    },
    drag(hit) { view.mark(hit.place, point = hit.point); scrape(hit); },
    release: endScrape,
    seen: turned,
  };
  try { view = new View(byId("view"), on); } catch (error) { byId("no-view").hidden = false; }

  function showNext() {
    const rows = [...byId("modes").rows], now = rows.findIndex(row => +row.dataset.mode === shown);
    show(+rows[(now + 1) % rows.length].dataset.mode);
  }

  const arrows = { ArrowLeft: ["right", -1], ArrowRight: ["right", 1], ArrowUp: ["up", 1], ArrowDown: ["up", -1] };
  byId("view").addEventListener("keydown", event => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key in arrows) {
      const [axis, sign] = arrows[event.key], axes = view?.axes() ?? { right: [1, 0, 0], up: [0, 0, 1] };
      before ??= { place: at(body.point_m, point), at: performance.now() - 100 };
      moveTo(neighbourAlong(body, point, axes[axis].map(x => sign * x)));
      if (event.shiftKey) scrape(hitAtPoint());
      else { before = null; say(`Marked point: ${placeInWords(body, at(body.point_m, point))}, number ${point}`); }
    } else if (key === "enter" || key === " ") strike(hitAtPoint());
    else if ("wasd".includes(key)) view?.turn(key === "a" ? -0.2 : key === "d" ? 0.2 : 0, key === "w" ? 0.2 : key === "s" ? -0.2 : 0);
    else if (key === "n") showNext();
    else if (key === "m") silence();
    else if (key === "escape") show(null);
    else return;
    event.preventDefault();
  });
  byId("view").addEventListener("keyup", event => { if (event.key === "Shift") endScrape(); });

  byId("modes").addEventListener("focusin", event => enter(event.target.closest("tr")));
  byId("modes").addEventListener("keydown", event => {
    const row = event.target.closest("tr"), next = { ArrowUp: row.previousElementSibling, ArrowDown: row.nextElementSibling }[event.key];
    if (!next) return;
    next.querySelectorAll("button")[[...row.querySelectorAll("button")].indexOf(event.target)].focus();
    event.preventDefault();
  });

  byId("spectrum").addEventListener("click", event => { // at a peak: its mode is shown
    const box = event.target.getBoundingClientRect(), f = plots.frequencyAt((event.clientX - box.left) / box.width);
    const far = Array.from(modes.freq_hz, one => Math.abs(Math.log(one / f)));
    show(far.indexOf(Math.min(...far)));
  });

  byId("strike").addEventListener("click", () => strike(hitAtPoint()));
  byId("loudest").addEventListener("click", () => { moveTo(body.tap.point); strike(hitAtPoint()); });
  byId("left").addEventListener("click", () => view?.turn(-0.3, 0));
  byId("right").addEventListener("click", () => view?.turn(0.3, 0));
  byId("rest").addEventListener("click", () => show(null));
  byId("next").addEventListener("click", showNext);
  byId("silence").addEventListener("click", silence);
  byId("controls").addEventListener("submit", event => event.preventDefault());
  byId("controls").addEventListener("reset", () => setTimeout(() => chooseBody(0), 0)); // once they are as they were
  byId("about").addEventListener("toggle", event => event.target.open && event.target.scrollIntoView({ block: "nearest" }));
  byId("controls").addEventListener("input", event => {
    if (event.target === controls.body) chooseBody(+controls.body.value);
    else change();
  });

  function makeButton(text, label, act) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: text });
    button.setAttribute("aria-label", label);
    button.addEventListener("click", act);
    return button;
  }

  byId("recordings").hidden = !page.recordings.length;
  byId("equal").checked = page.recordings.some(clip => clip.strike);
  byId("recordings").querySelector(".takes").replaceChildren(...page.recordings.flatMap(clip => {
    const row = Object.assign(document.createElement("div"), { className: "buttons" });
    for (const number of clip.strike?.bodies ?? []) {
      const { state, name } = page.bodies[number];
      row.append(makeButton(state, `Strike ${name} as for ${clip.name}`, () => strikeAsRecorded(number, clip.strike)));
    }
    row.append(makeButton("recording", `Play ${clip.name}`, () => playRecording(clip)));
    return [Object.assign(document.createElement("span"), { textContent: clip.name }), row];
  }));
  controls.body.replaceChildren(...page.bodies.map((one, i) => new Option(one.name, i)));
  byId("choose").hidden = page.bodies.length < 2;
  chooseBody(0);
  const tap = gainAt(body, modes, hitAtPoint(), at(body.normal, point)).map(g => g * body.tap.impulse_n_s);
  page.tap_energy = heardEnergy(modes, tap, settings().contact_s, page.heard_s, page.k_weighting).energy;

  function tick() {
    if (document.visibilityState === "visible") plots.update(sound);
    requestAnimationFrame(tick);
  }
  requestAnimationFrame(tick);
  requestAnimationFrame(() => setTimeout(() => { sound.prepare(); view?.hitMiddle(); }, 0)); // once the page is seen

  Object.assign(page, { sound, strike, show, hearAlone, hitAtPoint, moveTo, settings });
  Object.defineProperties(page, {
    body: { get: () => body }, modes: { get: () => modes }, point: { get: () => point }, view: { get: () => view },
    lastStrike: { get: () => lastStrike }, shown: { get: () => shown },
  });
})();
