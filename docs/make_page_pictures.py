"""Pictures of the pages that how-tos show: docs/how-to/pictures/*.png, by a headless Chromium.

python docs/make_page_pictures.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
PICTURES = REPO / "docs" / "how-to" / "pictures"
sys.path.insert(0, str(REPO))

from tests.made.chromium import Browser, chromium  # noqa: E402

MAIN = "from sonic_bullet.cli import main; main()"


def command(folder: Path, *words: str) -> None:
    """Run sonic-bullet."""
    subprocess.run([sys.executable, "-c", MAIN, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Make both pictures."""
    program = chromium()
    if program is None:
        raise SystemExit("no Chromium on PATH")
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command(folder, "bake", str(REPO / "assets" / "bowl.obj"), "--material", "steel", "-o", "bowl.html")
        scene = str(REPO / "scenes" / "tabletop.py")
        command(folder, "render", scene, "--seconds", "2", "-o", "tabletop.wav", "--page", "tabletop.html")
        browser = Browser(program, folder / "home")
        browser.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
        browser.go(folder / "bowl.html")
        browser.value("document.querySelector('#strike').click()")
        browser.until("page.sound.bank && page.sound.context.currentTime > 0.2")
        browser.value("document.querySelector('#strike').click()")
        browser.value("document.querySelector('#modes button').click()")
        time.sleep(1.0)
        browser.picture(PICTURES / "strike-bowl.png")
        browser.go(folder / "tabletop.html")
        browser.until("scene.view !== null")
        browser.value("scene.player.from = 0.55; document.querySelector('.lane button:not(.span)').click()")
        browser.until("scene.player.began !== null")
        browser.value("scene.player.stop()")
        time.sleep(0.5)
        browser.picture(PICTURES / "scene-tabletop.png")
        browser.end()


if __name__ == "__main__":
    main()
