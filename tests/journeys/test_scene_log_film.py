"""From a scene to its log, and from it to another microphone, level, material, to stems, a film: one gain for all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, read_audio_scale
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

SCENE = """
SECONDS = 0.3
MICROPHONE = (0, -0.6, 0.3)
def build(client):
    client.setGravity(0, 0, -9.81)
    board = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.1, 0.02]))
    bar = client.createMultiBody(
        0.2, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.08, 0.008, 0.004]), basePosition=[0, 0, 0.05])
    return {board: {"material": "wood", "name": "board", "count": 20}, bar: {"material": "steel", "name": "bar"}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("road")
    (folder / "scene.py").write_text(SCENE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "mix.wav", "--contacts", "log.npz") == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


@parametrize_few("words", [(), ("--pascals",), ("--tail", "0"), ("--peak-dbfs", "-6", "--tail", "-30")], (2, 3))
def test_scene_and_log_give_the_same_bytes_with_equal_options(words: tuple[str, ...]) -> None:
    assert run("render", "scene.py", "-o", "a.wav", *words) == 0
    assert run("render", "log.npz", "-o", "b.wav", *words) == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()


@parametrize_few("words", [(), ("--pascals",), ("--tail", "0")], 1)
def test_stems_have_the_mixs_gain_and_length_and_add_up_to_it(words: tuple[str, ...]) -> None:
    assert run("render", "log.npz", "-o", "with.wav", "--stems", "stems", "--cues", *words) == 0
    stems, mix = sorted(Path("stems").glob("*.wav")), soundfile.read("with.wav")[0]
    assert len(stems) == 2
    total = np.sum([soundfile.read(one)[0] for one in stems], axis=0)
    assert total.shape == mix.shape and np.abs(total - mix).max() <= 2 * 2**-23 * np.abs(mix).max()
    assert {read_audio_scale(one) for one in stems} == {read_audio_scale("with.wav")}


def test_the_scale_gives_pascals_back_at_another_microphone() -> None:
    far = ("--microphone", "0,-1.2,0.6")
    assert run("render", "log.npz", "-o", "near.wav") == run("render", "log.npz", "-o", "far.wav", *far) == 0
    assert run("render", "log.npz", "-o", "pa.wav", "--pascals", *far) == 0
    pascals, restored = read_audio("pa.wav")[0], read_audio("far.wav")[0]
    assert np.abs(restored - pascals).max() <= 2**-23 * np.abs(pascals).max()
    # both files peak at -1 dBFS, and what was twice as far away is still the quieter one
    assert np.abs(restored).max() < np.abs(read_audio("near.wav")[0]).max()


def test_stems_and_a_film_of_another_material_are_those_of_its_sound() -> None:
    """One log, its bar of glass and its board silent: mix, stems and film agree, and the log of it replays so."""
    pytest.importorskip("av")
    from tests.made.films import decoded

    words = ("--material", "bar=glass", "--silent", "board")
    assert run("render", "log.npz", "-o", "g.wav", "--stems", "g", "--contacts", "g.npz", *words) == 0
    assert run("film", "log.npz", "-o", "g.mov", "--size", "64x48", "--fps", "25", *words) == 0
    mix, film = soundfile.read("g.wav")[0], decoded(Path("g.mov"))
    stems = {one.stem.split("-", 1)[1]: soundfile.read(one)[0] for one in Path("g").glob("*.wav")}
    assert not stems.get("board", np.zeros(1)).any()
    assert np.abs(stems["bar"] - mix).max() <= 2**-22 and np.abs(film.sound[: len(mix)] - mix).max() < 2**-22
    assert run("render", "g.npz", "-o", "again.wav") == 0
    assert Path("again.wav").read_bytes() == Path("g.wav").read_bytes() != Path("mix.wav").read_bytes()


def test_a_film_has_the_same_sound_and_holds_its_last_picture() -> None:
    av = pytest.importorskip("av")
    assert run("film", "log.npz", "-o", "a.mov", "--size", "64x48", "--fps", "25") == 0
    from tests.made.films import decoded

    film, mix = decoded(Path("a.mov")), soundfile.read("mix.wav")[0]
    assert len(film.sound) >= len(mix) > 0.3 * 48_000
    assert np.abs(film.sound[: len(mix)] - mix).max() < 2**-22
    assert len(film.picture_s) == pytest.approx(len(mix) / 48_000 * 25, abs=1.0) and len(film.picture_s) > 0.3 * 25 + 1
    with av.open("a.mov") as file:
        assert f"full_scale_pa={read_audio_scale('mix.wav')!r}" in file.metadata["comment"]
