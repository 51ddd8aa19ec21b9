"""From a baked animation to its sound: a GLB and a JSON, scored, replayed from the log, with its scale and tail."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio_scale, read_log
from tests.apps.cli.test_commands import run
from tests.made.animations import dropped, keyframes, write_glb


@pytest.mark.parametrize("name", ["a.glb", "a.json"])
def test_an_animation_is_scored_and_its_log_replays(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    keys = dropped()
    if name.endswith("glb"):
        write_glb(tmp_path / name, keys)
    else:
        Path(name).write_text(json.dumps(keyframes(keys)))
    Path("table.json").write_text('[{"name": "box", "material": "wood"}]')
    how = ["--materials", "table.json"] if name.endswith("glb") else []
    assert run("score", name, *how, "-o", "a.wav", "--sr", "16000", "--contacts", "a.npz") == 0
    assert run("render", "a.npz", "-o", "b.wav") == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    file = soundfile.read("a.wav")[0]
    assert 20 * np.log10(np.abs(file).max()) == pytest.approx(-1, abs=0.05)
    assert read_audio_scale("a.wav") is not None and len(file) >= int(16_000 * read_log("a.npz").duration_s)
