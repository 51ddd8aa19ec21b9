// Modes of the body in another material and size, from those baked.
//
//   f₀ = f₀,material/s,   φ = φ_baked √(ρ/ρ') s^{-3/2},   P = P_material s^{-1/2},   kL: as it was
//   d = α/2 + own/s² + 2π|P|²/ρ₀c        own: β ω²/2 and what heat carries through the wall, both ∝ 1/s² there
//       [radiation/far_field.py; Rayleigh damping: Ren, Yeh, Lin 2013, eq. 6]

function modesOf(body, material, size) {
  const count = body.mode_count, made = body.materials[material];
  const modes = {};
  for (const name of ["freq_hz", "decay_per_s", "pressure_re", "pressure_im"]) modes[name] = new Float64Array(count);
  for (let m = 0; m < count; m++) {
    const re = made.pressure_re[m] / Math.sqrt(size), im = made.pressure_im[m] / Math.sqrt(size);
    const radiated = 2 * Math.PI * (re * re + im * im) * body.radiating_share / body.air_impedance;
    const decay = made.steady_per_s + made.own_per_s[m] / size ** 2 + radiated;
    const omega0 = 2 * Math.PI * made.freq0_hz[m] / size;
    modes.freq_hz[m] = Math.sqrt(Math.max(omega0 ** 2 - decay ** 2, 0)) / (2 * Math.PI);
    modes.decay_per_s[m] = decay;
    modes.pressure_re[m] = re;
    modes.pressure_im[m] = im;
  }
  modes.shape_factor = made.shape_factor * size ** -1.5;
  return modes;
}

// φ(p)·n of each mode: shapes at the corners of a triangle, weighted, along a direction. In 1/√kg.
function gainAt(body, modes, { corner, weight }, direction) {
  const gain = new Float64Array(body.mode_count), points = body.point_count;
  for (let m = 0; m < gain.length; m++) {
    for (let c = 0; c < corner.length; c++) {
      const at = 3 * (m * points + corner[c]);
      for (let x = 0; x < 3; x++) gain[m] += weight[c] * body.shape[at + x] * direction[x];
    }
    gain[m] *= modes.shape_factor;
  }
  return gain;
}

// Energy that is heard of a strike in its first seconds, of squared pressure at 1 m, weighted by K, in Pa² s; own: of
// each mode by itself and unweighted, as a meter at the microphone shows it.
//   p = Re Σ A e^{(-d + iω) t}:  ½ Σ_mn Re A_m A_n* (1 - e^{-z s})/z,  z = d_m + d_n - i(ω_m - ω_n): modes of one pitch add
function heardEnergy(modes, gain, contact_s, seconds, sections) {
  const count = gain.length, omega = modes.freq_hz.map(f => 2 * Math.PI * f), scale = gain.map((g, m) =>
    g * pulseSpectrum(modes.freq_hz[m], contact_s) * Math.sqrt(kWeighting(sections, modes.freq_hz[m])));
  const own = new Float64Array(count);
  let energy = 0;
  for (let m = 0; m < count; m++) {
    for (let n = m; n < count; n++) {
      const d = modes.decay_per_s[m] + modes.decay_per_s[n], w = omega[m] - omega[n];
      if (!scale[m] || !scale[n] || Math.abs(w) > 100 * d) continue; // less than a hundredth
      const re = modes.pressure_re[m] * modes.pressure_re[n] + modes.pressure_im[m] * modes.pressure_im[n];
      const im = modes.pressure_im[m] * modes.pressure_re[n] - modes.pressure_re[m] * modes.pressure_im[n];
      const fall = Math.exp(-d * seconds), c = 1 - fall * Math.cos(w * seconds), s = -fall * Math.sin(w * seconds);
      const a = re * c - im * s, b = re * s + im * c; // A_m A_n* (1 - e^{-z s}), then times z*/|z|²
      const part = (m === n ? 0.5 : 1) * scale[m] * scale[n] * (a * d - b * w) / (d * d + w * w);
      if (m === n) own[m] = part / kWeighting(sections, modes.freq_hz[m]);
      energy += part;
    }
  }
  return { energy, own };
}

// Power by which K-weighting scales a frequency: second-order sections at 48 kHz [ITU-R BS.1770-5, annex 1].
function kWeighting(sections, freq_hz) {
  const w = 2 * Math.PI * Math.min(freq_hz, 24000) / 48000;
  const power = (x, y, z) => x * x + y * y + z * z + 2 * y * (x + z) * Math.cos(w) + 2 * x * z * Math.cos(2 * w);
  return sections.reduce((gain, [b0, b1, b2, a0, a1, a2]) => gain * power(b0, b1, b2) / power(a0, a1, a2), 1);
}

// Size of the half-sine pulse's spectrum at a frequency, 1 at 0.
function pulseSpectrum(freq_hz, contact_s) {
  const x = 2 * freq_hz * contact_s;
  return Math.abs(1 - x * x) < 1e-6 ? Math.PI / 4 : Math.abs(Math.cos(Math.PI * x / 2) / (1 - x * x));
}

// Peak pressure of each mode at 1 m after a strike, in Pa.
function levelsOf(modes, gain, contact_s) {
  return Float64Array.from(gain, (g, m) =>
    Math.abs(g) * Math.hypot(modes.pressure_re[m], modes.pressure_im[m]) * pulseSpectrum(modes.freq_hz[m], contact_s));
}
