"""Page of takes that opens offline: a player each, its loudness, and the factors drawn for it.

    sound, gain, loudness, factors -> take_entry (FLAC) -> write_page: template, autoescaped -> one HTML file

Nothing is fetched: sounds stand in the page, without loss, so that the same takes give the same bytes. Its
Content-Security-Policy allows the one style by its hash and no script, so that a body's name never runs.
"""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files import replace_file
from sonic_bullet.files.storage.spooled_sound import KeptSound

STYLE = """
:root{color-scheme:light dark;--line:#8886}
body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:1.5rem auto;padding:0 1rem}
h1{font-size:1.4rem}h2{font-size:1.1rem;margin-bottom:.2rem}
section{border-top:1px solid var(--line);padding-bottom:1rem}
audio{width:100%}table{border-collapse:collapse;margin:.6rem 0}
td,th{text-align:left;padding:.2rem .8rem .2rem 0;border-bottom:1px solid var(--line)}
"""


def take_entry(
    name: str, sound: KeptSound, sr: int, gain_per_pa: float, loudness: str, drawn: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Collect the page's content for one take."""
    played_s = 30.0  # of each sound at most: 3 MB a channel
    import soundfile

    frames = min(sound.shape[1], round(played_s * sr))
    held = io.BytesIO()
    clipped = np.clip(sound.read(0, frames)[:2] * gain_per_pa, -1.0, 1.0)
    soundfile.write(held, clipped.T, sr, format="FLAC", subtype="PCM_16")
    return {
        "name": Path(name).name,
        "seconds": round(sound.shape[1] / sr, 3),
        "played_s": played_s if frames < sound.shape[1] else None,
        "loudness": loudness,
        "data": base64.b64encode(held.getvalue()).decode(),
        "drawn": [(who, key, f"{factor:.4g}") for who, of in drawn.items() for key, factor in of.items()],
    }


def write_page(path: str, entries: list[dict[str, Any]], title: str, note: str) -> None:
    """Write the page, whole or not at all. Raises FileError."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    engine = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    style_hash = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()  # [W3C CSP 3, section 2.3.1]
    text = engine.get_template("takes_page.html.jinja").render(
        title=title, note=note, entries=entries, style=Markup(STYLE), style_hash=style_hash
    )
    with replace_file(path) as file:
        file.write(text.encode("utf-8", "replace"))
