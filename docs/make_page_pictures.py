"""Pictures of the pages that how-tos show: docs/how-to/pictures/*.png, by a headless Chromium.

python docs/make_page_pictures.py      `make docs` does, where a page has changed since
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

from sonic_bullet.records import Material  # noqa: E402
from tests.made.case import make  # noqa: E402
from tests.made.chromium import Browser, chromium  # noqa: E402

MAIN = "from sonic_bullet.apps.cli import main; main()"


def command(folder: Path, *words: str) -> None:
    """Run sonic-bullet."""
    subprocess.run([sys.executable, "-c", MAIN, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Make the pictures."""
    program = chromium()
    if program is None:
        print("no Chromium on PATH: pictures of pages stay as they are")
        return
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command(folder, "bake", str(REPO / "assets" / "bowl.obj"), "--material", "steel", "-o", "bowl.html")
        scene = str(REPO / "scenes" / "tabletop.py")
        command(folder, "render", scene, "--seconds", "2", "-o", "tabletop.wav", "--page", "tabletop.html")
        brass = Material.isotropic(
            "made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8
        )
        make(folder, brass, (0.12, 0.025, 0.006), guess=(1.2e11, 8400.0, 0.34), strikes=4)
        command(folder, "fit", name, "-o", "bar.json", "--page", "fitted.html")
        browser = Browser(program, folder / "home")
        browser.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
        browser.go(folder / "bowl.html")
        browser.value("document.querySelector('#strike').click()")
        browser.until("page.sound.bank && page.sound.context.currentTime > 0.2")
        browser.value("document.querySelector('#strike').click()")
        browser.value("document.querySelector('#modes button').click()")
        time.sleep(1.0)
        browser.picture(PICTURES / "strike-bowl.png")
        browser.do("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        browser.value("document.querySelector('#modes tr:nth-child(6)').scrollIntoView({ block: 'center' })")
        time.sleep(0.5)
        browser.picture(PICTURES / "strike-phone.png", whole=False)
        browser.do("Emulation.clearDeviceMetricsOverride")
        browser.go(folder / "fitted.html")
        browser.value("document.querySelectorAll('.takes button')[1].click()")
        browser.until("page.sound.bank && page.sound.context.currentTime > 0.3")
        browser.picture(PICTURES / "strike-fitted.png")
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
