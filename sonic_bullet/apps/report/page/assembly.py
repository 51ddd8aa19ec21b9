"""Template, scripts, style and data -> one HTML file that loads nothing.

Two policies, of which both must agree: the first allows scripts by their hashes and what those load themselves, the
second nothing but what stands in the page or in a `data:` address. So a name in the data never runs, and the worklet,
which has no address in a page opened from a file, is loaded from a `data:` address by our own script alone.
    [W3C CSP 3, sections 2.3.1, 6.7.1.1; Web Audio API, 1.32; a Blob's address is refused from file://]
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records import Array

FOLDER = Path(__file__).parent
THREE = "vendor/three.min.js"


def write_page(
    path: str, template: str, scripts: Sequence[str], *, title: str, data: dict[str, Any], **shown: Any
) -> int:
    """Write a page, whole or not at all, and return its size in bytes.

    Parameters
    ----------
    path
        Where.
    template
        Name of a template in this folder.
    scripts
        Names of scripts in this folder, in the order in which they run.
    title, data
        What the template and the scripts get.
    shown
        More that the template gets.

    Raises
    ------
    FileError
    """
    text = page_text(template, scripts, title=title, data=data, **shown).encode()
    with replace_file(path) as file:
        file.write(text)
    return len(text)


def page_text(template: str, scripts: Sequence[str], *, title: str, data: dict[str, Any], **shown: Any) -> str:
    """Assemble the text of a page."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    engine = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    script = "\n".join(own_text(name) for name in scripts)
    three, style, bank = own_text(THREE), own_text("page.css"), own_text("bank.js")
    hashes = " ".join(f"'sha256-{sha256(text)}'" for text in (three, script))
    within = "default-src 'none'; base-uri 'none'; form-action 'none'"
    policies = (
        f"{within}; script-src {hashes} 'strict-dynamic'; style-src 'sha256-{sha256(style)}'",
        f"{within}; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'",
    )
    # `<` never stands in the data, so no text of it ends its element
    held = json_bytes(data).decode().replace("<", "\\u003c")
    return engine.get_template(template).render(
        title=title, data=Markup(held), style=Markup(style), policies=policies, bank=Markup(bank),
        three=Markup(three), script=Markup(script), **shown,
    )  # fmt: skip


def own_text(name: str) -> str:
    """Read a file of this folder, with the line ends that a browser hashes."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    assert "</script" not in text and "<!--" not in text, name
    return text


def encode_array(values: Array, kind: str) -> dict[str, str]:
    """Encode an array: {"type": f4, f8, u4 or i2, "base64": …}."""
    return {"type": kind, "base64": base64.b64encode(np.ascontiguousarray(values, f"<{kind}").tobytes()).decode()}


def sha256(text: str) -> str:
    """Hash an inline script or style for a policy [W3C CSP 3, section 2.3.1]."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
