"""Page of a diagnosis that opens offline: the verdict in words, sounds, pictures, and each candidate effect's evidence.

    Diagnosis -> players (WAV, 16 bit, one scale for all three sounds of a strike), spectrograms, (f, d) plane, table of
        candidate effects, and a page of its bodies in a frame -> one HTML file

Sounds and pictures stand in the page itself as data; nothing is fetched, as its policy says. In the frame is a page
with a policy of its own, and both must agree [W3C CSP 3, section 4.2: a frame of `srcdoc` has that of its page, too].
"""

from __future__ import annotations

import base64
import html
import inspect
import io
from typing import Any

import numpy as np

from sonic_bullet.effects.protocol import Effect
from sonic_bullet.files import replace_file
from sonic_bullet.lab.diagnosis.baseline_words import describe_baseline
from sonic_bullet.lab.diagnosis.deciding_measurement import next_measurement
from sonic_bullet.lab.diagnosis.diagnose import Diagnosis
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import object_evidence
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import predict_takes
from sonic_bullet.lab.diagnosis.selection.effect_table import HEAD, effect_table, explain_chance
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import short_time_power

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.25rem .8rem;border-bottom:1px solid #ddd;text-align:left}
img{max-width:100%}.verdict{font-size:1.4rem}figure{margin:1.5rem 0}figcaption{color:#555}\
audio{vertical-align:middle;width:16rem}\
iframe{width:100%;height:58rem;border:1px solid #ddd;border-radius:6px}"""


POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; media-src data:; "
    "style-src 'unsafe-inline'; script-src 'unsafe-inline' data:"
)


def write_report(path: str, d: Diagnosis, proposal: str = "", struck: str = "") -> None:
    """Write the page, whole or not at all. Raises FileError."""
    with replace_file(path) as file:
        file.write(page(d, proposal, struck).encode())


def page(d: Diagnosis, proposal: str = "", struck: str = "") -> str:
    """Render the page's text.

    Parameters
    ----------
    d
        What was found.
    proposal
        The strike that would tell most, in words, where it was asked for.
    struck
        Text of the page on which the bodies are struck before and after; empty where none has a shape.
    """
    named = ", ".join(f"{c.id} ({c.effect.owner.value})" for c in d.closed.added)
    words = {
        "none": "The model suffices: no known effect brings it nearer to strikes it was not fitted to.",
        "explained": f"What the model lacks has a name: {named}."
        + (" It does not lack that alone." if d.unexplained else ""),
        "unexplained": "Something is left that none of the known effects accounts for.",
        "worse-than-silence": "What was fitted is farther from the recordings than silence, with every effect.",
        "nothing": "Nothing could be compared, so nothing is known of what the model lacks.",
    }
    name = html.escape(d.case.name)
    parts = [
        f'<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv="Content-Security-Policy" '
        f'content="{POLICY}"><title>{name}</title><style>{STYLE}</style>',
        f"<h1>{name}</h1><p class=verdict><b>{d.verdict}</b>. "
        f"{words['nothing' if type(d.closed) is NothingCompared else d.verdict]}</p>",
        _effects(d),
        _errors(d),
        f"<p>{html.escape(d.unexplained['words'])}.</p>" if d.unexplained else "",
        _format_struck(struck),
        _players(d),
        _plane(d),
        _candidates(d),
        _notes(d),
        _next_strike(d, proposal),
        "</html>",
    ]
    return "\n".join(part for part in parts if part)


def _effects(d: Diagnosis) -> str:
    rows = [
        (
            c.id,
            c.effect.owner.value,
            ", ".join(_parameter(name, value) for name, value in c.effect.parameters().items()),
            f"{c.mean_db:.2f} dB ± {c.sd_db:.2f}",
            f"{c.control_db:.2f} dB",
            c.effect.reference,
        )
        for c in d.closed.added
    ]
    formulas = "".join(f"<h3>{c.id}</h3><pre>{html.escape(_formula(c.effect))}</pre>" for c in d.closed.added)
    return (
        "<h2>What was added</h2>"
        + _table(("effect", "belongs to", "parameters", "nearer on strikes left out", "chance", "source"), rows)
        + f"<p>{explain_chance()}</p>"
        + formulas
        if rows
        else ""
    )


def _formula(effect: Effect) -> str:
    """Return the equations at the head of an effect's module, empty where it has none."""
    said = (inspect.getdoc(inspect.getmodule(type(effect))) or "").split("\n\n")
    equations = said[1] if len(said) > 1 else ""
    return equations if equations.startswith(" ") or {"=", "->"} & set(equations.partition("\n")[0].split()) else ""


def _errors(d: Diagnosis) -> str:
    rows = []
    for split in ("fit", "holdout", "transfer"):
        values = [d.errors[side].get(split) for side in ("before", "after")] + [
            d.errors_sone[side].get(split) for side in ("before", "after")
        ]
        if any(v is not None for v in values) or split in d.not_compared:
            rows.append((split, *(f"{v:.2f}" if v is not None else _why_none(d, split) for v in values)))
    floor = f"Two noisy takes of one sound: {d.errors['floor']:.2f} dB." if d.errors["floor"] is not None else ""
    return (
        "<h2>How far from the recordings</h2>"
        f"{_table(('strikes', 'before, dB', 'after, dB', 'before, sone', 'after, sone'), rows)}<p>{floor}</p>"
    )


def _why_none(d: Diagnosis, split: str) -> str:
    return "not compared" if split in d.not_compared else "no audio"


def _players(d: Diagnosis) -> str:
    drawn = 2  # strikes of a split with pictures; all have players
    parts, seen = [], dict.fromkeys(("fit", "holdout", "transfer"), 0)
    takes = [t for t in (*d.takes, *d.unfitted) if np.isfinite(t.sample).all()]
    both = [predict_takes(h, takes) for h in (d.closed.before, d.closed.after)]
    played_peak = 0.9
    for take in takes:
        before, after = (take.synthesize(made[take.body]) for made in both)
        peak = max(float(np.abs(x).max()) for x in (take.sample, before, after)) or 1.0
        sounds = (("recorded", take.sample), ("before", before), ("after", after))
        row = "".join(
            f"{label} <audio controls preload=none src='{_wav(x / peak * played_peak, take.sr)}'></audio> "
            for label, x in sounds
        )
        split = take.body.recordings[take.strike].split
        seen[split] += 1
        picture = (
            _figure(_spectrograms(sounds, take.sr), "recorded, before, after; dB below the loudest")
            if seen[split] <= drawn
            else ""
        )
        parts.append(f"<h3>{html.escape(take.name)}, {split}</h3><p>{row}</p>{picture}")
    return "<h2>Hear and see</h2>" + "".join(parts) if parts else ""


def _format_struck(text: str) -> str:
    if not text:
        return ""
    said = (
        "Each recording has buttons <i>before</i> and <i>after</i>, which strike the body where it was struck, and "
        "<i>recording</i>; all are of one loudness. These are the modes alone: what acts on a force or a sound, such "
        "as a room, is in the players below."
    )
    return f'<h2>Strike it</h2><p>{said}</p><iframe title="Strike it" srcdoc="{html.escape(text)}"></iframe>'


def _plane(d: Diagnosis) -> str:
    body = next((b for b in d.bodies if b.recorded is not None), None)
    if body is None:
        return ""
    plt = _pyplot()
    figure, axis = plt.subplots(figsize=(9, 4.5))
    before, after = (object_evidence(predict(h, body)) for h in (d.closed.before, d.closed.after))
    axis.plot(before.freq_hz, before.decay_per_s, "k.", label="observed lines")
    axis.vlines(
        before.freq_hz, before.expected_decay_per_s, before.decay_per_s, color="0.7", lw=1, label="residual before"
    )
    axis.plot(before.freq_hz, before.expected_decay_per_s, "x", color="#c33", label="model before")
    axis.plot(after.freq_hz, after.expected_decay_per_s, "+", color="#28c", label="model after")
    if len(before.foreign_hz):
        axis.plot(
            before.foreign_hz,
            np.maximum(before.foreign_decay_per_s, 0.02),
            "o",
            mfc="none",
            color="#888",
            label="lines that are no mode",
        )
    axis.set(xlabel="frequency in Hz", ylabel="decay in 1/s", yscale="log")
    axis.legend(frameon=False)
    return "<h2>Frequencies and decays</h2>" + _figure(
        _png(figure), "each observed line, and where the model has its mode"
    )


def _candidates(d: Diagnosis) -> str:
    drop = {c.id: " ".join(f"{x:+.2f}" for x in c.drop_db) for c in (*d.closed.tried, *d.closed.added)}
    rows = [(*row.cells(), drop[row.id]) for row in effect_table(d.closed)]
    head = (*HEAD, "strike by strike, each left out in turn")
    silent = "<p>Candidates that do not stand here found nothing of theirs in the recordings.</p>"
    return "<h2>Candidate effects</h2>" + (f"{_table(head, rows)}<p>{explain_chance()}</p>" if rows else "") + silent


def _notes(d: Diagnosis) -> str:
    items = "".join(f"<li>{html.escape(w)}</li>" for w in d.warnings)
    text = f"Baseline: {describe_baseline(d)}."
    return f"<h2>Notes</h2><p>{text}</p><ul>{items}</ul>"


def _next_strike(d: Diagnosis, proposal: str) -> str:
    said = [next_measurement(d.found, d.closed, d.unexplained), proposal]
    rows = "".join(f"<p>{html.escape(one)}.</p>" for one in said if one)
    return f"<h2>Next strike</h2>{rows}" if rows else ""


def _table(head: tuple[str, ...], rows: list[Any]) -> str:
    body = "".join("<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{''.join(f'<th>{html.escape(h)}</th>' for h in head)}</tr>{body}</table>"


def _parameter(name: str, value: Any) -> str:
    """Format a parameter with its unit behind the number, where its name ends in one."""
    units = {
        "per_n_s": "1/(N·s)", "n_s_m": "N·s/m", "per_s": "1/s", "n_s": "N·s", "m_s": "m/s", "n_m": "N/m", "hz": "Hz",
        "pa": "Pa", "db": "dB", "kg": "kg", "s": "s", "m": "m",
    }  # fmt: skip
    end = next((end for end in units if name.endswith(f"_{end}")), "")
    return f"{name.removesuffix(f'_{end}')} = {_number(value)} {units[end]}" if end else f"{name} = {_number(value)}"


def _number(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_number(v) for v in value) + "]"
    if isinstance(value, dict):
        return ", ".join(f"{k} {_number(v)}" for k, v in value.items())
    return str(value)


def _wav(sample: Array, sr: int) -> str:
    """Encode samples as a data URI."""
    import soundfile

    held = io.BytesIO()
    soundfile.write(held, np.clip(sample, -1, 1), sr, format="WAV", subtype="PCM_16")
    return "data:audio/wav;base64," + base64.b64encode(held.getvalue()).decode()


def _spectrograms(sounds: Any, sr: int) -> str:
    plt = _pyplot()
    figure, axes = plt.subplots(1, len(sounds), figsize=(12, 3.6), sharey=True)
    window = 2048
    tables = [10 * np.log10(short_time_power(x, window, window // 4).T + 1e-20) for _, x in sounds]
    top = max(float(t.max()) for t in tables)
    for axis, (label, x), table in zip(axes, sounds, tables, strict=True):
        image = axis.imshow(
            table - top,
            origin="lower",
            aspect="auto",
            extent=(0, len(x) / sr, 0, sr / 2000),
            vmin=-90,
            vmax=0,
            cmap="magma",
        )
        axis.set(title=label, xlabel="time in s")
    axes[0].set_ylabel("frequency in kHz")
    figure.colorbar(image, ax=axes, label="dB")
    return _png(figure)


def _figure(source: str, caption: str) -> str:
    return (
        f"<figure><img src='{source}' alt='{html.escape(caption)}'>"
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _png(figure: Any) -> str:
    held = io.BytesIO()
    figure.savefig(held, format="png", dpi=90, bbox_inches="tight", metadata={"Software": None})
    _pyplot().close(figure)
    return "data:image/png;base64," + base64.b64encode(held.getvalue()).decode()


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt
