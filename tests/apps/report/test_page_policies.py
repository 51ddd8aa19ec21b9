"""No page loads anything from a network: each says so in a policy, and none names an address to load from."""

from __future__ import annotations

import hashlib
import re
from html import unescape
from pathlib import Path

import pytest

from sonic_bullet.apps.report import diagnosis_page
from sonic_bullet.apps.report.page import assembly
from sonic_bullet.apps.report.states_page import states_page
from sonic_bullet.lab.states.state_comparison import ComparedStates
from tests.made.chromium import opened_page

PACKAGE = Path(assembly.__file__).resolve().parents[3]
LOADED = re.compile(
    r"""(src|href|srcset|action)\s*=\s*["']?\s*(https?:)?//|url\(\s*["']?(https?:)?//|@import|importScripts"""
)


def test_every_page_has_a_policy_and_loads_nothing() -> None:
    written = {
        file: text
        for file in PACKAGE.rglob("*")
        if file.suffix in (".py", ".jinja") and "<!doctype html" in (text := file.read_text(encoding="utf-8"))
    }
    assert len(written) >= 6
    for file, text in written.items():
        head = text[text.index("<!doctype html") :]
        assert "Content-Security-Policy" in head.split("<style>")[0], file
        assert not LOADED.search(text), file
    for file in assembly.FOLDER.glob("*.[jc]s*"):
        assert not LOADED.search(file.read_text(encoding="utf-8")), file
    assert assembly.own_text("bank.js")  # where those are
    made = (
        assembly.page_text("scene.html.jinja", (), title="", data={}, full_scale_pa=1.0),
        f"default-src{diagnosis_page.POLICY.partition('default-src')[2]}",
        states_page(ComparedStates((), (), None), [], b""),
    )
    for text in made:
        policy = text.split("<style>")[0]
        assert "default-src 'none'" in unescape(policy)
        assert "//" not in policy and "*" not in policy  # no address, and none of any kind


def test_what_is_bundled_is_what_its_page_says() -> None:
    bundled = assembly.FOLDER / assembly.THREE
    said = re.findall(r"\b[0-9a-f]{64}\b", (bundled.parent / "README.md").read_text(encoding="utf-8"))
    assert said == [hashlib.sha256(bundled.read_bytes()).hexdigest()]
    assert "MIT License" in (bundled.parent / "three.LICENSE").read_text(encoding="utf-8")


@pytest.mark.chromium
def test_a_page_of_states_keeps_its_own_policy(tmp_path: Path) -> None:
    page = tmp_path / "states.html"
    page.write_text(states_page(ComparedStates((), (), None), ["<script>document.title = 'ran'</script>"], b""))
    with opened_page(page, tmp_path / "home") as opened:
        assert opened.value("getComputedStyle(document.body).maxWidth") == "1120px"  # its style is let in
        opened.value("document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\\'document.title=1\\'>')")
        assert opened.value("fetch('https://example.org/').then(() => 'came', () => 'refused')") == "refused"
        assert opened.value("document.title") == ""
        assert any("Content Security Policy" in one for one in opened.errors)
