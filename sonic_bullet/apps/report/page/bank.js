// A bank of a body's modes, as the engine plays them: strike_playback.py says the same in Python.
//
//   y = P z:   y[n] = y[n-1] e^s + Σ w_j a e^{s (n - u_j)},   a = P (1 + i d/ω) φ(p)·J,   s = (-d + iω)/rate
//   pressure at 1 m = Re Σ y - Y, in pascals; P: pressure at 1 m per modal velocity, φ(p)·J: impulse on the mode
//   Y: all that the force about sample n would send by y: what lasts sends nothing (src/bank/bank.hpp)
//
// Runs in an AudioWorklet, where registerProcessor is known; tests run the same text elsewhere.

const NODES_PER_PULSE = 24, NODES_PER_SAMPLE = 2, SHORTEST_PULSE = 1e-12; // those of src/bank/strike_pool.hpp
const SILENCED_S = 0.02; // in which a hand ends the ringing, without a click
const SILENT_PA = 1e-10; // a mode below it is put to rest: 114 dB below what an ear hears

// A half-sine pulse of length contact_s from sample `start` on, as impulses at nodes u_j = (j + 1/2)/cells.
class Pulse {
  constructor(start, contact_s, rate) {
    const length = Math.max(contact_s * rate, SHORTEST_PULSE);
    const cells = Math.max(NODES_PER_SAMPLE, Math.ceil(NODES_PER_PULSE / length));
    const nodes = Math.ceil(cells * length);
    this.weight = Float64Array.from({ length: nodes }, (_, j) =>
      Math.max(Math.sin(Math.PI * (j + 0.5) / cells / length), 0));
    const sum = this.weight.reduce((a, b) => a + b, 0);
    this.weight.forEach((w, j) => { this.weight[j] = w / sum; });
    this.start = start;
    this.length = length;
    this.width = Math.min(cells, nodes); // nodes that arrive at one sample
    this.samples = Math.ceil(nodes / cells);
    this.delay = Float64Array.from({ length: this.width }, (_, k) => 1 - (k + 0.5) / cells); // in samples
  }

  // Impulses that arrive at samples at … at + count: a row of `width` a sample. False: none does.
  fill(impulse, at, count) {
    const first = Math.max(0, this.start + 1 - at), last = Math.min(count, this.start + 1 + this.samples - at);
    if (first >= last) return false;
    impulse.fill(0, 0, count * this.width);
    for (let i = first; i < last; i++) {
      const cell = (at + i - this.start - 1) * this.width;
      for (let k = 0; k < this.width && cell + k < this.weight.length; k++) {
        impulse[i * this.width + k] = this.weight[cell + k];
      }
    }
    return true;
  }

  // Of impulses of 1 with each delay, all that they send: what the pulse sends about each sample, taken from sum.
  takeLasting(sum, at, count, lasting) {
    const first = Math.max(0, this.start - at), last = Math.min(count, Math.ceil(this.start + this.length + 0.5) - at);
    if (first >= last) return;
    const whole = this.weight.reduce((all, w, j) => all + w * lasting[j % this.width], 0);
    const acted = n => 0.5 - 0.5 * Math.cos(Math.PI * Math.min(Math.max((n - 0.5 - this.start) / this.length, 0), 1));
    for (let i = first; i < last; i++) sum[i] -= whole * (acted(at + i + 1) - acted(at + i));
  }

  ended(at) { return at > this.start + this.samples; }
}

// A point that is drawn over a rough surface: force k h(x), x the distance swept, never more than the load.
// Its place moves: column 0 are the modes where it was, column 1 where it is going, faded over FADE samples.
class Scrape {
  static FADE = 1024;

  constructor(surface, rate) {
    Object.assign(this, surface); // stiffness_n_m, load_n, spacing_m, height_m: samples of the profile
    this.rate = rate;
    this.width = 2;
    this.delay = Float64Array.of(0, 0);
    this.place = this.speed = this.wanted = this.strength = 0;
    this.faded = Scrape.FADE;
    this.released = false;
  }

  fill(impulse, at, count) {
    const n = this.height_m.length;
    for (let i = 0; i < count; i++) {
      this.speed += (this.wanted - this.speed) / (0.01 * this.rate); // in 10 ms
      this.strength += ((this.released || this.wanted < 1e-3 ? 0 : 1) - this.strength) / (0.005 * this.rate);
      this.place += this.speed / this.rate / this.spacing_m;
      const cell = Math.floor(this.place), part = this.place - cell;
      const height = (1 - part) * this.height_m[cell % n] + part * this.height_m[(cell + 1) % n];
      const force = this.load_n * Math.tanh(this.stiffness_n_m * height / this.load_n) * this.strength;
      this.faded = Math.min(this.faded + 1, Scrape.FADE);
      const to = this.faded / Scrape.FADE;
      impulse[2 * i] = (1 - to) * force / this.rate;
      impulse[2 * i + 1] = to * force / this.rate;
    }
    return true;
  }

  takeLasting(sum, at, count, lasting, impulse) {
    for (let i = 0; i < count; i++) sum[i] -= impulse[2 * i] * lasting[0] + impulse[2 * i + 1] * lasting[1];
  }

  ended() { return this.released && this.strength < 1e-4; }
}

// Self-affine profile, rms 1, periodic: midpoints are displaced by less at each finer octave [Peitgen, Saupe 1988].
function selfAffine(count, hurst, seed) {
  const random = () => { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; return seed / 2 ** 31 - 1; };
  const height = new Float64Array(count);
  for (let step = count, size = 1; step > 1; step /= 2, size *= 2 ** -hurst) {
    for (let i = 0; i < count; i += step) {
      height[i + step / 2] = (height[i] + height[(i + step) % count]) / 2 + size * random();
    }
  }
  const mean = height.reduce((a, b) => a + b) / count;
  const rms = Math.sqrt(height.reduce((a, b) => a + (b - mean) ** 2, 0) / count);
  return height.map(h => (h - mean) / rms);
}

class ModalBank {
  constructor(rate, largestBlock = 128) {
    this.rate = rate;
    this.drives = [];
    this.count = 0;
    this.sum = new Float64Array(largestBlock);
  }

  // New modes; where there are as many as before they ring on, at their new pitch.
  setModes(modes) {
    const { freq_hz, decay_per_s, pressure_re, pressure_im } = this.modes = modes;
    if (freq_hz.length !== this.count) {
      this.count = freq_hz.length;
      this.re = new Float64Array(this.count + 1); // and one that is none, for `free`
      this.im = new Float64Array(this.count + 1);
      this.drives = [];
    }
    Object.assign(this, { decay_per_s, pressure_re, pressure_im });
    this.omega = freq_hz.map(f => 2 * Math.PI * f);
    this.audible = this.omega.map((w, m) => // as `audible` of bank/instrument.py
      +(w > 0 && w < Math.PI * this.rate && w > 1e-3 * decay_per_s[m] && decay_per_s[m] < 2 * this.rate));
    const size = decay_per_s.map((d, m) => this.audible[m] * Math.exp(-d / this.rate));
    this.turn_re = new Float64Array(this.count + 1);
    this.turn_im = new Float64Array(this.count + 1);
    this.omega.forEach((w, m) => {
      this.turn_re[m] = size[m] * Math.cos(w / this.rate);
      this.turn_im[m] = size[m] * Math.sin(w / this.rate);
    });
  }

  // a e^{s delay} of each mode (row) and delay (column); gain: φ(p)·J of each mode, in N s/√kg.
  response(gain, delay) {
    const width = delay.length, re = new Float64Array(this.count * width), im = new Float64Array(this.count * width);
    for (let m = 0; m < this.count; m++) {
      if (!this.audible[m] || !gain[m]) continue;
      const w = this.omega[m], d = this.decay_per_s[m], turn = d / w;
      const a = gain[m] * (this.pressure_re[m] - turn * this.pressure_im[m]);
      const b = gain[m] * (this.pressure_im[m] + turn * this.pressure_re[m]);
      for (let k = 0; k < width; k++) {
        const t = delay[k] / this.rate, size = Math.exp(-d * t), c = size * Math.cos(w * t), s = size * Math.sin(w * t);
        re[m * width + k] = a * c - b * s;
        im[m * width + k] = a * s + b * c;
      }
    }
    return { re, im };
  }

  // Real part of all that a drive's responses add over the samples to come, Σ_m a e^{s delay}/(1 - e^s), by delay.
  lasting({ force, re, im }) {
    const width = force.width, all = new Float64Array(width);
    for (let m = 0; m < this.count; m++) {
      const c = 1 - this.turn_re[m], s = this.turn_im[m], size = c * c + s * s;
      for (let k = 0; k < width; k++) all[k] += (re[m * width + k] * c - im[m * width + k] * s) / size;
    }
    return all;
  }

  drive(force, gain) {
    const drive = { force, ...this.response(gain, force.delay), impulse: new Float64Array(0) };
    drive.lasting = this.lasting(drive);
    this.drives.push(drive);
    return drive;
  }

  // A strike from sample `start` on.
  strike(start, gain, contact_s) { this.drive(new Pulse(start, contact_s, this.rate), gain); }

  // Draws a point over the body: gain φ(p)·n of a force of 1 N there, at a speed in m/s. null: it is taken off.
  scrape(gain, speed_m_s, surface) {
    let drive = this.drives.find(one => one.force instanceof Scrape && !one.force.released);
    if (!gain) { if (drive) drive.force.released = true; return; }
    if (!drive) {
      this.profile ??= selfAffine(2 ** 14, surface.hurst, 1);
      surface = { ...surface, height_m: this.profile.map(h => h * surface.roughness_m) };
      drive = this.drive(new Scrape(surface, this.rate), gain);
    } else {
      const next = this.response(gain, [0]), done = drive.force.faded / Scrape.FADE;
      for (const part of ["re", "im"]) {
        for (let m = 0; m < this.count; m++) {
          drive[part][2 * m] += done * (drive[part][2 * m + 1] - drive[part][2 * m]);
          drive[part][2 * m + 1] = next[part][m];
        }
      }
      drive.lasting = this.lasting(drive);
      drive.force.faded = 0;
    }
    drive.force.wanted = speed_m_s;
  }

  // Adds the samples at … at + out.length, in pascals at 1 m, to out.
  render(out, at) {
    const count = out.length, sum = this.sum.fill(0, 0, count);
    this.drives = this.drives.filter(drive => !drive.force.ended(at));
    const active = this.drives.filter(drive => {
      if (drive.impulse.length < count * drive.force.width) drive.impulse = new Float64Array(count * drive.force.width);
      return drive.force.fill(drive.impulse, at, count);
    });
    if (active.length) this.driven(sum, count, active);
    else this.free(sum, count);
    for (const { force, lasting, impulse } of this.drives) force.takeLasting(sum, at, count, lasting, impulse);
    for (let i = 0; i < count; i++) out[i] += sum[i];
  }

  // Nothing strikes: four modes side by side, for each step of one waits for the step before.
  free(sum, count) {
    const ringing = [];
    for (let m = 0; m < this.count; m++) if (this.re[m] !== 0 || this.im[m] !== 0) ringing.push(m);
    while (ringing.length % 4) ringing.push(this.count); // a mode that is none
    const { re, im, turn_re, turn_im } = this;
    for (let r = 0; r < ringing.length; r += 4) {
      const m0 = ringing[r], m1 = ringing[r + 1], m2 = ringing[r + 2], m3 = ringing[r + 3];
      let a0 = re[m0], a1 = re[m1], a2 = re[m2], a3 = re[m3], b0 = im[m0], b1 = im[m1], b2 = im[m2], b3 = im[m3];
      const c0 = turn_re[m0], c1 = turn_re[m1], c2 = turn_re[m2], c3 = turn_re[m3];
      const s0 = turn_im[m0], s1 = turn_im[m1], s2 = turn_im[m2], s3 = turn_im[m3];
      for (let i = 0; i < count; i++) {
        const n0 = a0 * c0 - b0 * s0, n1 = a1 * c1 - b1 * s1, n2 = a2 * c2 - b2 * s2, n3 = a3 * c3 - b3 * s3;
        b0 = a0 * s0 + b0 * c0;
        b1 = a1 * s1 + b1 * c1;
        b2 = a2 * s2 + b2 * c2;
        b3 = a3 * s3 + b3 * c3;
        sum[i] += n0 + n1 + n2 + n3;
        a0 = n0, a1 = n1, a2 = n2, a3 = n3;
      }
      this.keep(m0, a0, b0);
      this.keep(m1, a1, b1);
      this.keep(m2, a2, b2);
      this.keep(m3, a3, b3);
    }
  }

  keep(m, re, im) {
    const silent = re * re + im * im < SILENT_PA * SILENT_PA;
    this.re[m] = silent ? 0 : re;
    this.im[m] = silent ? 0 : im;
  }

  // Something strikes or scrapes.
  driven(sum, count, active) {
    for (let m = 0; m < this.count; m++) {
      let re = this.re[m], im = this.im[m];
      const c = this.turn_re[m], s = this.turn_im[m];
      for (let i = 0; i < count; i++) {
        const next = re * c - im * s;
        im = re * s + im * c;
        re = next;
        for (let a = 0; a < active.length; a++) {
          const drive = active[a], width = drive.force.width;
          for (let k = 0; k < width; k++) {
            const impulse = drive.impulse[i * width + k];
            re += impulse * drive.re[m * width + k];
            im += impulse * drive.im[m * width + k];
          }
        }
        sum[i] += re;
      }
      this.keep(m, re, im);
    }
  }
}

if (typeof registerProcessor === "function") {
  registerProcessor("modal-banks", class extends AudioWorkletProcessor {
    constructor({ processorOptions }) {
      super();
      this.banks = [];
      this.fading = []; // {bank, left}: that were silenced
      this.spare = new Float32Array(128);
      this.port.onmessage = ({ data }) => this.obey(data);
      for (const order of processorOptions.orders) this.obey(order);
    }

    obey({ bank: number = 0, modes, strike, scrape, silence }) {
      if (silence && this.banks[number]) {
        const { modes: kept } = this.banks[number], left = Math.round(SILENCED_S * sampleRate);
        this.fading.push({ bank: this.banks[number], left, whole: left });
        this.banks[number] = new ModalBank(sampleRate);
        this.banks[number].setModes(kept);
      }
      const bank = this.banks[number] ??= new ModalBank(sampleRate);
      if (modes) bank.setModes(modes);
      if (strike) bank.strike(Math.max(currentFrame, Math.round(strike.at_s * sampleRate)), strike.gain, strike.contact_s);
      if (scrape) bank.scrape(scrape.gain, scrape.speed_m_s, scrape.surface);
    }

    process(_, [[out]]) {
      for (const bank of this.banks) bank?.render(out, currentFrame);
      for (const one of this.fading) {
        one.bank.render(this.spare.fill(0), currentFrame);
        for (let i = 0; i < out.length; i++) out[i] += this.spare[i] * Math.max(one.left - i, 0) / one.whole;
        one.left -= out.length;
      }
      this.fading = this.fading.filter(one => one.left > 0);
      return true;
    }
  });
}
