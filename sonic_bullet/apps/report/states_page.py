"""Page of compared states that opens offline: the answer in words, the picture, two players a comparison, every number.

    ComparedStates -> words, picture (PNG), takes (FLAC), table of the certain changes -> one HTML file

Sounds and pictures stand in the page itself as data; nothing is fetched, nothing runs: its Content-Security-Policy
allows the one style by its hash and no script.
"""

from __future__ import annotations

import base64
import html
import io

import numpy as np

from sonic_bullet.apps.report.page.assembly import sha256
from sonic_bullet.files import replace_file
from sonic_bullet.lab.states.changes import UNITS
from sonic_bullet.lab.states.recorded_states import RecordedState
from sonic_bullet.lab.states.state_comparison import ComparedStates, StateComparison

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;text-align:left}
img{max-width:100%}.verdict{font-size:1.3rem}pre{white-space:pre-wrap}audio{vertical-align:middle;width:16rem}"""


POLICY = (
    f"default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; media-src data:; "
    f"style-src 'sha256-{sha256(STYLE)}'"
)


def write_states_page(path: str, found: ComparedStates, lines: list[str], picture_png: bytes) -> None:
    """Write the page, whole or not at all. Raises FileError."""
    with replace_file(path) as file:
        file.write(states_page(found, lines, picture_png).encode("utf-8", "replace"))


def states_page(found: ComparedStates, lines: list[str], picture_png: bytes) -> str:
    """Render the page's text; lines: what the command says; picture_png: of the states."""
    names = html.escape(" → ".join(state.name for state in found.states))
    picture = base64.b64encode(picture_png).decode()
    words = "\n".join(line for line in lines if "─" not in line)
    parts = [
        f'<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv="Content-Security-Policy" '
        f'content="{POLICY}"><title>{names}</title><style>{STYLE}</style>',
        f"<h1>What changed? {names}</h1>",
        *(_comparison(one) for one in found.comparisons),
        f"<h2>Picture</h2><img alt='spectra, T60 and difference' src='data:image/png;base64,{picture}'>",
        f"<h2>In words</h2><pre>{html.escape(words)}</pre></html>",
    ]
    return "\n".join(parts)


def _comparison(one: StateComparison) -> str:
    before, after = one.changes.before.state, one.changes.after.state
    rows = "".join(
        f"<tr><td>{row.kind}<td>{row.freq_hz:.1f}<td>{_value(row.change, row.kind)}<td>{_value(row.low, row.kind)} to "
        f"{_value(row.high, row.kind)}</tr>"
        for row in sorted(one.changes.rows, key=lambda row: (list(UNITS).index(row.kind), row.freq_hz))
        if row.certain
    )
    table = f"<table><tr><th>what<th>Hz<th>change<th>between</tr>{rows}</table>" if rows else ""
    said = "".join(f"<p>{html.escape(cause.name)}: {html.escape(cause.words)}.</p>" for cause in one.causes)
    return (
        f"<h2>{html.escape(before.name)} → {html.escape(after.name)}</h2>"
        f"<p class=verdict><b>{html.escape(one.verdict)}</b></p>{said}"
        f"<p>{_player(before)} {_player(after)}</p>{table}"
    )


def _value(value: float, kind: str) -> str:
    return f"×{value:.3g}" if UNITS[kind] == "ratio" else f"{value:+.3g} {UNITS[kind]}"


def _player(state: RecordedState) -> str:
    """Return a player of the state's first take, at −1 dBFS."""
    played_s = 4.0
    import soundfile

    sound = state.takes[0].signal[: round(played_s * state.sr)]
    held = io.BytesIO()
    soundfile.write(
        held, 0.89 * sound / max(float(np.abs(sound).max()), 1e-9), state.sr, format="FLAC", subtype="PCM_16"
    )
    data = base64.b64encode(held.getvalue()).decode()
    return f"{html.escape(state.name)} <audio controls preload=none src='data:audio/flac;base64,{data}'></audio>"
