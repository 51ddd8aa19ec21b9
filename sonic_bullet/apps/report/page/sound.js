// From the bank to the ear: worklet (pascals at 1 m) -> distance -> meters -> volume -> loudspeaker.

const START_S = 0.005; // a strike begins so much after it is asked for, at the same sample in the bank and beside it

function bankAddress() {
  const text = document.getElementById("bank").textContent;
  return "data:text/javascript;base64," + btoa(unescape(encodeURIComponent(text)));
}

// The bank in any context, live or offline; orders are carried out before its first sample.
async function bankIn(context, orders = []) {
  await context.audioWorklet.addModule(bankAddress());
  return new AudioWorkletNode(context, "modal-banks", {
    numberOfInputs: 0, outputChannelCount: [1], processorOptions: { orders },
  });
}

class Sound {
  constructor(fullScalePa) {
    this.fullScalePa = fullScalePa;
    this.distance_m = 1;
    this.volume_db = 0;
    this.orders = []; // until the bank is there
    this.played = []; // clips
  }

  // All that takes time before the first strike, but for the loudspeaker: a browser opens that once somebody has
  // touched the page.
  prepare() { return this.opening ??= this.make(); }

  async open() {
    this.asked_ms ??= performance.now();
    if (this.context && this.context.state !== "running") this.resumed = this.context.resume(); // while it is a press
    await this.prepare();
    await (this.resumed ??= this.context.resume());
  }

  async make() {
    this.context = new AudioContext({ latencyHint: "interactive" });
    this.atMicrophone = this.context.createGain();
    this.meter = this.context.createAnalyser();
    this.meter.fftSize = 8192;
    this.meter.smoothingTimeConstant = 0;
    this.output = this.context.createGain();
    this.atMicrophone.connect(this.meter).connect(this.output).connect(this.context.destination);
    this.place();
    const bank = await bankIn(this.context, this.orders);
    bank.connect(this.atMicrophone);
    this.bank = bank;
  }

  order(order) {
    if (this.bank) this.bank.port.postMessage(order);
    else this.orders.push(order);
  }

  place() {
    if (!this.context) return;
    this.atMicrophone.gain.setTargetAtTime(1 / this.distance_m, this.context.currentTime, 0.02);
    this.output.gain.setTargetAtTime(this.scale(), this.context.currentTime, 0.02);
  }

  // Of the loudspeaker's full scale, a pascal.
  scale() { return 10 ** (this.volume_db / 20) / this.fullScalePa; }

  setModes(modes) {
    const { freq_hz, decay_per_s, pressure_re, pressure_im } = modes;
    this.orders = this.orders.filter(order => !order.modes);
    this.order({ modes: { freq_hz, decay_per_s, pressure_re, pressure_im } });
  }

  strike(gain, contact_s, clip = null, clipGain = 0) {
    const at_s = this.context ? this.context.currentTime + START_S : 0;
    this.order({ strike: { at_s, gain, contact_s } });
    if (clip && this.context && clipGain > 0) this.play(clip, clipGain, at_s);
  }

  play(clip, gain, at_s = 0) {
    const source = this.context.createBufferSource(), level = this.context.createGain();
    source.buffer = this.bufferOf(clip);
    level.gain.value = gain;
    source.connect(level).connect(this.atMicrophone);
    source.start(at_s);
    this.played.push(source);
    source.onended = () => { this.played = this.played.filter(one => one !== source); };
  }

  bufferOf(clip) {
    if (!clip.buffer) {
      clip.buffer = this.context.createBuffer(1, clip.samples.length, clip.sr);
      clip.buffer.getChannelData(0).set(Float32Array.from(clip.samples, s => s / 32767 * clip.full_scale_pa));
    }
    return clip.buffer;
  }

  // Ends what rings and what is played, as a hand on the body does.
  silence() {
    this.order({ silence: true });
    this.played.forEach(one => one.stop());
    this.played = [];
  }

  scrape(gain, speed_m_s, surface) { this.order({ scrape: { gain, speed_m_s, surface } }); }
}
