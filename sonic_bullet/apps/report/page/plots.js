// What is heard, drawn: levels by frequency now, and the level over the last seconds.

const QUIET_PA = 2e-5; // 0 dB SPL
// rms of a sine over what an AnalyserNode shows of it (Blackman window, 0.42 A/2), and 1 Pa is 94 dB SPL
const ANALYSER_DB = 94 + 20 * Math.log10(Math.SQRT1_2 / 0.21);
const LOBE = 3; // bins from the middle of a line's spectrum to its edge (Blackman window)
const NAMED_S = 0.5; // between two namings of what sounds: time to read one
const BAND_HZ = [50, 20000], LEVELS_DB = [0, 130], HISTORY_S = 4;

function decibels(pascals) { return 20 * Math.log10(Math.max(pascals, 1e-12) / QUIET_PA); }

class Plots {
  constructor(spectrum, history, words, pitches) {
    Object.assign(this, { spectrum, history, words, pitches });
    this.named_s = -NAMED_S;
    this.past = []; // [time in s, level in dB]
    this.marks = [];
  }

  // Frequencies of modes and their levels after the last strike, dB.
  setMarks(marks) { this.marks = marks; }

  update(sound) {
    if (sound.context?.state !== "running") {
      if (!this.drawn && this.spectrum.clientWidth) { // axes, before anything sounds
        this.drawn = true;
        this.drawSpectrum(null);
        this.drawHistory(0);
      }
      return;
    }
    const meter = sound.meter, now = sound.context.currentTime;
    this.wave ??= new Float32Array(meter.fftSize);
    meter.getFloatTimeDomainData(this.wave);
    const newest = this.wave.subarray(this.wave.length - 1024);
    const rms = Math.sqrt(newest.reduce((sum, x) => sum + x * x, 0) / newest.length);
    this.level_db = decibels(rms);
    this.past.push([now, this.level_db]);
    while (this.past.length && this.past[0][0] < now - HISTORY_S) this.past.shift();
    this.drawSpectrum(meter, sound.context.sampleRate);
    this.drawHistory(now);
    if (now - this.named_s >= NAMED_S) {
      this.named_s = now;
      this.pitches.textContent = this.loudestNow(sound.context.sampleRate / meter.fftSize).map(f => `${f.toFixed(0)} Hz`).join(", ") || "nothing";
    }
    const loudest = newest.reduce((most, x) => Math.max(most, Math.abs(x)), 0) * sound.scale();
    this.words.textContent = this.level_db <= 0 ? "silent" : `${this.level_db.toFixed(0)} dB SPL at the microphone`
      + (loudest > 1 ? ", too loud for the loudspeaker: turn the volume down" : "");
  }

  // Frequencies of the three modes that are loudest at the microphone now, of what the spectrum tells apart.
  loudestNow(bin_hz) {
    const found = [], level = f => this.bins[Math.round(f / bin_hz)] + ANALYSER_DB;
    const order = this.marks.map(([f]) => f).filter(f => f < BAND_HZ[1] && level(f) > LEVELS_DB[0]).sort((a, b) => level(b) - level(a));
    for (const f of order) if (found.length < 3 && found.every(one => Math.abs(one - f) > LOBE * bin_hz)) found.push(f);
    return found;
  }

  sheet(canvas) {
    const ratio = Math.min(devicePixelRatio, 2), width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d"), style = getComputedStyle(canvas);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.strokeStyle = pen.fillStyle = style.color;
    pen.font = "11px system-ui, sans-serif";
    return { pen, width, height, accent: style.getPropertyValue("--accent").trim() };
  }

  y(db, height) { return height - 14 - (height - 18) * (db - LEVELS_DB[0]) / (LEVELS_DB[1] - LEVELS_DB[0]); }

  // The frequency at a place of the spectrum, 0 to 1 of its width.
  frequencyAt(part) { return BAND_HZ[0] * (BAND_HZ[1] / BAND_HZ[0]) ** part; }

  drawSpectrum(meter, rate) {
    const { pen, width, height, accent } = this.sheet(this.spectrum);
    const x = f => width * Math.log(f / BAND_HZ[0]) / Math.log(BAND_HZ[1] / BAND_HZ[0]); // frequencyAt is its inverse
    pen.globalAlpha = 0.35;
    for (const [f, name] of [[100, "100 Hz"], [1000, "1 kHz"], [10000, "10 kHz"]]) {
      pen.fillRect(x(f), 0, 0.5, height - 12);
      pen.fillText(name, Math.min(x(f) + 3, width - pen.measureText(name).width), height - 3);
    }
    pen.globalAlpha = 0.5;
    for (const [f, db] of this.marks) {
      if (f > BAND_HZ[0] && f < BAND_HZ[1] && db > LEVELS_DB[0]) pen.fillRect(x(f), 0, 1, 6);
    }
    pen.globalAlpha = 1;
    if (!meter) return;
    this.bins ??= new Float32Array(meter.frequencyBinCount);
    meter.getFloatFrequencyData(this.bins); // dB of 1 Pa
    pen.strokeStyle = accent;
    pen.beginPath();
    let column = -1, most = -Infinity;
    for (let k = 1; k < this.bins.length; k++) {
      const f = k * rate / meter.fftSize;
      if (f < BAND_HZ[0] || f > BAND_HZ[1]) continue;
      const here = Math.floor(x(f));
      if (here !== column && column >= 0) { pen.lineTo(column, this.y(most, height)); most = -Infinity; }
      column = here;
      most = Math.max(most, this.bins[k] + ANALYSER_DB, LEVELS_DB[0]);
    }
    pen.stroke();
  }

  drawHistory(now) {
    const { pen, width, height, accent } = this.sheet(this.history);
    const x = t => width * (1 - (now - t) / HISTORY_S);
    pen.globalAlpha = 0.35;
    for (let db = 20; db < LEVELS_DB[1]; db += 20) {
      pen.fillRect(0, this.y(db, height), width, 0.5);
      pen.fillText(`${db} dB`, 3, this.y(db, height) - 2);
    }
    for (let s = 1; s < HISTORY_S; s++) pen.fillText(`−${s} s`, x(now - s), height - 2);
    pen.globalAlpha = 1;
    pen.strokeStyle = accent;
    pen.beginPath();
    for (const [t, db] of this.past) pen.lineTo(x(t), this.y(Math.max(db, LEVELS_DB[0]), height));
    pen.stroke();
  }
}
