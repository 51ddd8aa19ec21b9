"""Page of comparisons that opens offline: verdict and cause first, players that switch at the same sample.

    Comparison -> page_entry (words, Ogg, PNG) -> write_page: template, autoescaped -> one HTML file

Both sounds are started by one clock at one time, and a switch changes the gains alone: the same sample goes on. Nothing
is fetched: sounds and pictures stand in the page. Its Content-Security-Policy allows the one style and the one script
below by their hashes, so that the name of a body or a file never runs. Sounds are lossy (Ogg Vorbis) and scaled by one
factor for both, and included only where something differs.
"""

from __future__ import annotations

import base64
import hashlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.comparison_record import Comparison
from sonic_bullet.apps.compare.outcome.sound_effects import at_common_rate
from sonic_bullet.files import replace_file
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import short_time_power

# where a picture's axes begin and end, as fractions of its width, for the cursor
AXES_LEFT = 0.09
AXES_RIGHT = 0.98

STYLE = """
:root{color-scheme:light dark;--line:#8886}
body{font:16px/1.5 system-ui,sans-serif;max-width:64rem;margin:1.5rem auto;padding:0 1rem}
h1{font-size:1.4rem}h2{font-size:1.15rem;margin-bottom:.2rem}
section{border-top:1px solid var(--line);padding-bottom:1rem}
.verdict{font-size:1.1rem;font-weight:600;overflow-wrap:anywhere}
table{border-collapse:collapse;width:100%;margin:.6rem 0}caption{text-align:left;font-weight:600}
td,th{text-align:left;padding:.25rem .6rem;border-bottom:1px solid var(--line);vertical-align:top}
.cause td{font-weight:600}.wide{overflow-x:auto}
.players{display:flex;flex-wrap:wrap;gap:.6rem;align-items:center}.players input{flex:1 1 12rem}
button{font:inherit;padding:.35rem .9rem}output{min-width:4.5em}
:focus-visible{outline:3px solid #48f;outline-offset:2px}
figure{margin:.8rem 0}img{width:100%;height:auto;background:#fff}.cursor-of{position:relative}
.cursor{position:absolute;top:0;bottom:0;width:2px;background:#f40;pointer-events:none}
"""

SCRIPT = """
for (const box of document.querySelectorAll('.players')) {
  const audios = [...box.querySelectorAll('audio')], play = box.querySelector('[data-do=play]');
  const change = box.querySelector('[data-do=switch]'), slide = box.querySelector('input');
  const shown = box.querySelector('output'), cursor = box.parentElement.querySelector('.cursor');
  let now = 0, from = 0, began = null, busy = false, context, gains, sounds, sources;
  const at = () => began === null ? from : Math.min(from + Math.max(0, context.currentTime - began), +slide.max);
  const draw = () => {
    slide.value = at(); shown.textContent = at().toFixed(2) + ' s';
    if (cursor) {
      const left = +cursor.dataset.left, right = +cursor.dataset.right;
      cursor.hidden = false;
      cursor.style.left = 100 * (left + (right - left) * at() / slide.max) + '%';
    }
  };
  const bytes = x => Uint8Array.from(atob(x.src.split(',')[1]), c => c.charCodeAt(0)).buffer;
  const open = async () => {
    context = new AudioContext();
    sounds = await Promise.all(audios.map(x => context.decodeAudioData(bytes(x))));
    gains = sounds.map((_, i) => {
      const gain = context.createGain();
      gain.connect(context.destination); gain.gain.value = +(i === now);
      return gain;
    });
  };
  const start = async () => {
    if (busy) return;
    busy = true;
    try { if (!gains) await open(); await context.resume(); } finally { busy = false; }
    began = context.currentTime + 0.02;
    sources = sounds.map((sound, i) => {
      const source = context.createBufferSource();
      source.buffer = sound; source.connect(gains[i]); source.start(began, from);
      return source;
    });
    play.textContent = 'Stop'; tick();
  };
  const stop = () => { from = at(); began = null; sources.forEach(x => x.stop()); play.textContent = 'Play'; draw(); };
  const tick = () => {
    if (began === null) return;
    if (at() >= +slide.max) { stop(); from = 0; }
    draw(); requestAnimationFrame(tick);
  };
  const toggle = () => { if (began === null) start(); else stop(); };
  const turn = () => {
    now = 1 - now;
    change.querySelector('b').textContent = audios[now].dataset.side;
    if (gains) gains.forEach((x, i) => { x.gain.value = +(i === now); });
  };
  play.addEventListener('click', toggle);
  change.addEventListener('click', turn);
  slide.addEventListener('input', () => {
    const playing = began !== null, to = +slide.value;
    if (playing) stop();
    from = to; draw();
    if (playing) start();
  });
  box.addEventListener('keydown', e => {
    if (e.key === 'x' || e.key === 'X') { turn(); e.preventDefault(); }
    if (e.key === ' ' && e.target === box) { toggle(); e.preventDefault(); }
  });
}
"""


def page_entry(found: Comparison) -> dict[str, Any]:
    """Collect the page's content for one comparison: texts, and sounds and pictures (base64) if something differs."""
    described = found.to_json()
    entry: dict[str, Any] = {
        "name": Path(found.b.name).name,
        "passed": found.passed,
        "verdict": found.verdict,
        "differences": described["differences"],
        "effects": described["effects"],
        "exact": found.exact,
        "causes": len(found.causes),
        "audible": None if found.audible is None else found.audible.words,
        "notes": list(found.notes),
        "left": AXES_LEFT,
        "right": AXES_RIGHT,
        "sounds": [],
    }
    if found.same or not found.a.sound.shape[1] or not found.b.sound.shape[1]:
        return entry
    one, other, sr = at_common_rate(found.a.sound.samples(), found.b.sound.samples(), found.a.sr, found.b.sr)
    played_s = 12.0  # of each sound at most, so that twenty scenes stay below 5 MB
    n = min(max(one.shape[1], other.shape[1]), round(played_s * sr))
    one, other = (np.pad(x[:2], ((0, 0), (0, max(0, n - x.shape[1]))))[:, :n] for x in (one, other))
    peak = max(float(np.abs(one).max()), float(np.abs(other).max())) or 1.0
    played_peak = 0.9
    entry["sounds"] = [
        {"name": name, "type": "audio/ogg", "data": _ogg(x / peak * played_peak, sr)}
        for name, x in (("A", one), ("B", other))
    ]
    entry["seconds"] = round(n / sr, 3)
    entry["picture"] = _picture(found, one, other, sr)
    return entry


def write_page(path: str, entries: list[dict[str, Any]], title: str = "Two versions compared") -> None:
    """Write the page, whole or not at all. Raises FileError."""
    with replace_file(path) as file:
        file.write(page(entries, title).encode())


def page(entries: list[dict[str, Any]], title: str = "Two versions compared") -> str:
    """Render the page's text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    engine = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    whole = [{"picture": None, "seconds": 0, **entry} for entry in entries]
    return engine.get_template("compare_page.html.jinja").render(
        title=title, entries=whole, same=sum(entry["passed"] for entry in whole),
        style=Markup(STYLE), script=Markup(SCRIPT), style_hash=_hash(STYLE), script_hash=_hash(SCRIPT),
    )  # fmt: skip


def _hash(text: str) -> str:
    """Hash an inline style or script for a Content-Security-Policy [W3C CSP 3, section 2.3.1]."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _ogg(x: Array, sr: int) -> str:
    import soundfile

    if sr > 48_000:
        x, _, sr = at_common_rate(x, x, sr, 48_000)
    held = io.BytesIO()
    with soundfile.SoundFile(held, "w", sr, len(x), format="OGG", subtype="VORBIS", compression_level=0.7) as file:
        for start in range(0, x.shape[1], 4096):  # libsndfile's encoder overflows its stack on long writes
            file.write(x[:, start : start + 4096].T)
    return base64.b64encode(held.getvalue()).decode()


def _picture(found: Comparison, one: Array, other: Array, sr: int) -> str:
    from matplotlib.figure import Figure

    tables = [_levels(x, sr) for x in (one, other)]
    top = max(float(t.max()) for t in tables)
    figure = Figure(figsize=(9, 6.4))
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[3, 3, 3, 1.4])
    figure.subplots_adjust(left=AXES_LEFT, right=AXES_RIGHT, top=0.99, bottom=0.08, hspace=0.1)
    extent = (0, one.shape[1] / sr, 0, sr / 2000)
    for axis, table, name in zip(axes, tables, "AB", strict=False):
        axis.imshow(np.maximum(table - top, -90), origin="lower", aspect="auto", extent=extent, vmin=-90, vmax=0)
        axis.set_ylabel(f"{name}, kHz")
    change = np.maximum(tables[1], top - 90) - np.maximum(tables[0], top - 90)
    axes[2].imshow(change, origin="lower", aspect="auto", extent=extent, cmap="coolwarm", vmin=-12, vmax=12)
    axes[2].set_ylabel("B − A, kHz")
    for row, side in ((1, found.a), (0, found.b)):
        if side.log is not None:
            starts = side.log.start_s
            at = [starts[i] for i, step in enumerate(side.log.steps) if len(step.contacts)]
            axes[3].plot(at, np.full(len(at), row), "|", color="k", ms=9, mew=0.6)
    axes[3].set(yticks=[0, 1], yticklabels=["B", "A"], ylim=(-0.7, 1.7), xlabel="time in s", xlim=extent[:2])
    axes[3].set_ylabel("contacts")
    held = io.BytesIO()
    figure.savefig(held, format="webp", dpi=80, pil_kwargs={"quality": 60})
    return base64.b64encode(held.getvalue()).decode()


def _levels(x: Array, sr: int) -> Array:
    """Compute levels (frequencies, windows) in dB, all channels together, at most 800 windows."""
    window = 1024
    hop = max(256, x.shape[1] // 800)
    padded = np.pad(x, ((0, 0), (window // 2, window // 2)))  # a window shows at its middle
    power = short_time_power(padded, window, hop).sum(axis=0)
    return np.asarray(10 * np.log10(power.T[:: 2 if sr > 24_000 else 1] + 1e-30))
