"""The add-on in a window of Blender: panels are drawn, a key cancels, and what did not change is not computed again.

SONIC_BULLET_BLENDER names a Blender of 4.2 or later that opens windows; Xvfb gives them a display.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.records import Array

REPO = Path(__file__).resolve().parents[2]
ADDON = REPO / "addons" / "blender" / "sonic_bullet_blender"
PATIENCE_S = 900


def shown_in_blender(folder: Path) -> Any:
    """What the scenario tells; its pictures are in the folder."""
    blender, server = os.environ.get("SONIC_BULLET_BLENDER"), shutil.which("Xvfb")
    if not blender or server is None:
        pytest.skip("no Blender with a window: name one in SONIC_BULLET_BLENDER, and install Xvfb")
    packed = folder / "add_on.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for file in ADDON.glob("*.*"):
            archive.write(file, file.name)
    (folder / "home").mkdir()
    (folder / "temporary").mkdir()
    own = {"HOME": str(folder / "home"), "TMPDIR": str(folder / "temporary"), "LIBGL_ALWAYS_SOFTWARE": "1"}
    environment = os.environ | own | {"SONIC_BULLET_CACHE": str(folder / "cache")}
    install = [blender, "--command", "extension", "install-file", "-r", "user_default", "-e", str(packed)]
    subprocess.run(install, check=True, env=environment, capture_output=True, timeout=PATIENCE_S)
    told, screen = os.pipe()
    display = subprocess.Popen(
        [server, "-displayfd", str(screen), "-screen", "0", "1280x960x24", "-fbdir", str(folder)],
        pass_fds=[screen], env=environment, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(screen)
    try:
        with os.fdopen(told) as number:
            environment["DISPLAY"] = ":" + number.readline().strip()
        beside = Path(sys.executable).with_name("sonic-bullet")
        words = ["--factory-startup", "--enable-event-simulate", "--window-geometry", "0", "0", "1280", "960"]
        script = str(Path(__file__).with_name("in_a_window.py"))
        done = subprocess.run(
            [blender, *words, "--python", script, "--", str(beside), str(folder)],
            check=False, env=environment, capture_output=True, text=True, timeout=PATIENCE_S,
        )  # fmt: skip
    finally:
        display.kill()
        display.wait()
    assert "Traceback" not in done.stderr + done.stdout, done.stderr[-2000:]  # a panel that fails is told there alone
    return json.loads((folder / "told.json").read_text())


def read_screen(file: Path) -> Array:
    """Rows of red, green and blue of an XWD file of 24 bits [X11, XWDFile.h: 25 numbers, colours, then rows]."""
    held = file.read_bytes()
    header = struct.unpack(">25I", held[:100])
    width, height, row_bytes = header[4], header[5], header[12]
    rows = np.frombuffer(held, np.uint8, row_bytes * height, header[0] + 12 * header[19]).reshape(height, row_bytes)
    return np.ascontiguousarray(rows[:, : 4 * width].reshape(height, width, 4)[..., 2::-1])


@pytest.mark.slow
@pytest.mark.timeout(PATIENCE_S)
def test_the_extension_in_a_window(tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=tmp_path) as name:
        folder = Path(name)
        told = shown_in_blender(folder)
        assert told["window"] and "error" not in told, told
        assert "pip install" in told["missing"] and "pip install" in told["missing_in_panel"]
        assert told["kept_while_baking"] == 1
        missing, baking = (read_screen(folder / f"{name}.xwd") for name in ("missing", "baking"))
        assert missing.shape == baking.shape == (960, 1280, 3) and len(np.unique(baking)) > 50
        assert (missing[640:, 1060:] != baking[640:, 1060:]).any()  # the panel, below at the right
        assert told["cancelled"] == {"words": "cancelled", "alive": False, "kept": [], "files": [], "markers": 0}
        bakes = [told[name] for name in ("first", "again", "changed")]
        for one in bakes:
            assert one["words"] == "" and one["kept"] == []
            assert one["strips"][0][:3] == ["sonic_bullet", "SOUND", 1] and one["markers"]
        assert [len(one["strips"]) for one in bakes] == [1, 1, 4]  # the third has a sound of each body, too
        assert [strip[4] for strip in bakes[2]["strips"]] == [False, True, True, True]
        first, again, changed = (set(one["cache"]) for one in bakes)
        assert first == again
        new = sorted(Path(one).name.split("-")[0] for one in changed - again)
        assert new == ["modes", "radiation"]  # of the one body whose material is another
