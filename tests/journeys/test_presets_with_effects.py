"""Every effect that a preset can hold, played: preset -> scene -> render -> WAV, whose lines are those that the preset
says in closed form, within 2 %.

A bar hangs in the air without gravity and a ball strikes its end, so nothing carries it and no support takes of it. A
vibrometer reads the corner, where a bending mode moves most: what the file holds is the level that effects speak of.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet import load_material
from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.effects.presets_of_effects import KEPT_EFFECTS
from sonic_bullet.effects.protocol import Owner, Stage
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.recorded_lines import RecordedLines
from sonic_bullet.files import presets, read_log
from sonic_bullet.radiation.far_field import radiation
from sonic_bullet.records import Air
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few
from tests.made.lines import line_at

SCENE = """
import pybullet as p
import sonic_bullet as sb

SECONDS = 0.5
SIZE_M = {size}
MICROPHONE = sb.Vibrometer(0, [0.5 * x for x in SIZE_M], [0, 0, 1])


def build(client):
    bar = client.createMultiBody(0.2, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5 * x for x in SIZE_M]))
    ball = client.createMultiBody(
        0.002,
        client.createCollisionShape(p.GEOM_SPHERE, radius=0.004),
        basePosition=[0.46 * SIZE_M[0], 0.3 * SIZE_M[1], 0.5 * SIZE_M[2] + 0.0045],
    )
    client.resetBaseVelocity(ball, [0, 0, -1.0])
    for body in (bar, ball):
        client.changeDynamics(body, -1, restitution=0.6, linearDamping=0, angularDamping=0)
    sb.keep_restitution(client)
    return {{bar: "d.json"}}
"""
BAR_M, SQUARE_M, PLATE_M = (0.18, 0.025, 0.006), (0.2, 0.012, 0.012), (0.2, 0.14, 0.002)
STRIP_M = (0.18, 0.012, 0.001)
WITHIN = 0.02


class Played:
    """A preset's sound and what `modes` says of it, by the command line. changes: to the preset's groups."""

    def __init__(self, folder: Path, size: tuple[float, ...], name: str = "steel", **changes: Any) -> None:
        preset = json.loads((presets.TABLES_FOLDER / f"{name}.json").read_text())
        for key, value in changes.items():
            preset[key] = {**preset[key], **value} if isinstance(value, dict) else value
        (folder / "d.json").write_text(json.dumps(preset))
        (folder / "scene.py").write_text(SCENE.format(size=size))
        assert run("render", "scene.py", "-o", "a.wav", "--contacts", "a.npz", "--json", "a.json") == 0
        sound, self.sr = soundfile.read(folder / "a.wav", dtype="float64")
        self.sound = sound / json.loads((folder / "a.json").read_text())["gain_per_pa"]
        self.start_s = float(np.argmax(np.abs(self.sound) > 0.02 * np.abs(self.sound).max())) / self.sr
        half = np.array(size) / 2
        corner = [half * (1 if k & 1 else -1, 1 if k & 2 else -1, 1 if k & 4 else -1) for k in range(8)]
        face = (
            "f 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\nf 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6"
        )
        rows = [f"v {x} {y} {z}" for x, y, z in corner]
        (self.model,) = (body.model for body in read_log("a.npz").bodies if body.model is not None)
        (folder / "bar.obj").write_text("\n".join(rows) + "\n" + face + "\n")
        assert run("modes", "bar.obj", "--material", "d.json", "--to-hz", 9000, "--json", "m.json") == 0
        modes = json.loads((folder / "m.json").read_text())["modes"]
        self.freq_hz = np.array([one["freq_hz"] for one in modes])
        self.decay_per_s = np.array([one["decay_per_s"] for one in modes])

    def line(self, near_hz: float, start_s: float = 0.03, stop_s: float = 0.3, **how: float) -> tuple[float, ...]:
        """Frequency, decay and amplitude between two times after the strike."""
        return line_at(self.sound, self.sr, near_hz, self.start_s + start_s, self.start_s + stop_s, **how)

    def level(self, mode: int) -> float:
        """Peak velocity of a mode at the surface over what the vibrometer reads of it."""
        shape = self.model.shape[:, :, mode].astype(float)
        corner = np.argmax(self.model.vertex_m.astype(float) @ (1.0, 1.0, 1.0))
        return float(np.linalg.norm(shape, axis=1).max() / abs(shape[corner, 2]))

    def bending(self, count: int = 3) -> np.ndarray:
        """Places of the lowest bending modes about y: those nearest the ratios of a slender beam, below."""
        want = self.freq_hz[0] * np.array([1.0, 2.757, 5.404])[:count]  # (β_n L)², n = 1 … 3, over the first
        return np.array([np.argmin(np.abs(self.freq_hz / f - 1.0 + 0.03)) for f in want])


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def total(**more: Any) -> dict[str, Any]:
    """Damping that has its radiation in it."""
    return {
        "loss_factor": None,
        "equal_at_hz": None,
        "alpha_per_s": 4.0,
        "beta_s": 5e-9,
        "includes_radiation": True,
    } | more


LAWS = {
    "constant-loss": ({"eta": 2e-3}, lambda w: 0.5 * 2e-3 * w),
    "power": ({"eta": 2e-3, "exponent": 0.5}, lambda w: 0.5 * 2e-3 * np.sqrt(2000 * np.pi * w)),
    "relaxation": (
        {"eta": 1e-3, "strength": 4e-3, "tau_s": 5e-5},
        lambda w: 0.5 * w * (1e-3 + 4e-3 * w * 5e-5 / (1 + (w * 5e-5) ** 2)),
    ),
}


@parametrize_few("law", LAWS, 1)
def test_a_damping_law_is_in_the_sound_and_in_the_modes(folder: Path, law: str) -> None:
    numbers, decay = LAWS[law]
    played = Played(folder, BAR_M, effects=[{"id": "damping-law", "law": law, **numbers}], damping=total())
    for k in played.bending():
        want = decay(2 * np.pi * played.freq_hz[k])
        assert played.decay_per_s[k] == pytest.approx(want, rel=1e-3)
        freq, found, _ = played.line(played.freq_hz[k])
        assert found == pytest.approx(want, rel=WITHIN), played.freq_hz[k]
        assert freq == pytest.approx(played.freq_hz[k], rel=2e-4)


def test_radiation_is_counted_once(folder: Path) -> None:
    """A thin glass plate loses a good part to the air: with it in the preset's law nothing is added, else its own."""
    law = [{"id": "damping-law", "law": "constant-loss", "eta": 1e-3}]
    extra = None
    for kept in (True, False):
        played = Played(folder, PLATE_M, "glass", effects=law, damping=total(includes_radiation=kept))
        model = played.model
        extra = radiation(model, Air())[1] if extra is None else extra
        apart = np.minimum(np.diff(played.freq_hz, prepend=0), np.diff(played.freq_hz, append=1e5))
        alone = np.flatnonzero((apart > 150) & (played.freq_hz < 4000))
        checked = 0
        for k in alone[np.argsort(-extra[alone] / model.decay_per_s[alone])][:2]:
            want = 0.5e-3 * 2 * np.pi * played.freq_hz[k] + (0 if kept else extra[k])
            found = played.line(played.freq_hz[k], 0.03, 0.15, width_s=0.008)[1]
            assert found == pytest.approx(want, rel=WITHIN)
            checked += extra[k] > 0.1 * model.decay_per_s[k]
        assert checked


def test_a_split_pair_sounds_as_two_lines(folder: Path) -> None:
    """A square bar bends both ways at one frequency; an imperfection turned by 45° is struck in both."""
    split = 0.04
    plain = Played(folder, SQUARE_M, damping=total())
    pair = plain.freq_hz[0]
    assert plain.freq_hz[1] == pytest.approx(pair, rel=1e-4)
    effect = {"id": "mode-splitting", "freq_hz": [pair], "split": [split], "turn_rad": [np.pi / 4]}
    played = Played(folder, SQUARE_M, damping=total(), effects=[effect])
    for sign in (-1, 1):
        want = pair * (1 + sign * split / 2)
        assert np.abs(played.freq_hz[:2] / want - 1).min() < 1e-4
        freq, decay, level = played.line(want, 0.1, 0.4, reach=0.008, width_s=0.025)
        assert freq / pair - 1 == pytest.approx(sign * split / 2, rel=WITHIN)
        assert decay == pytest.approx(0.5 * (4.0 + 5e-9 * (2 * np.pi * want) ** 2), rel=WITHIN)
        assert level > 0.2 * plain.line(pair, 0.1, 0.4, width_s=0.025)[2]


@parametrize_few(("measure", "bend"), [("velocity", 6.0), ("velocity", -4.0), ("displacement", 2.5e8)], 2)
def test_pitch_that_goes_with_level_early_and_late(folder: Path, measure: str, bend: float) -> None:
    """f = f₀ (1 + b L²) with L the peak velocity (or displacement) of the mode at the surface."""
    played = Played(
        folder,
        BAR_M,
        damping=total(alpha_per_s=12.0),
        effects=[{"id": "amplitude-pitch", "bend": bend, "measure": measure}],
    )
    k = played.bending(1)[0]
    f0 = played.freq_hz[k]
    rise = []
    for start in (0.02, 0.12, 0.22):
        freq, _, level = played.line(f0, start, start + 0.05)
        level *= played.level(k) / (1.0 if measure == "velocity" else 2 * np.pi * f0)
        want = bend * level**2
        assert freq / f0 - 1 == pytest.approx(want, rel=WITHIN, abs=2e-5)
        rise.append(want)
    assert abs(rise[0]) > 3e-3 and abs(rise[0]) > 5 * abs(rise[2])


@parametrize_few(("power", "growth"), [(1, 25.0), (2, 25.0), (1, 8.0)], 1)
def test_damping_that_goes_with_level_early_and_late(folder: Path, power: int, growth: float) -> None:
    """d = d₀ (1 + (c L)^p)."""
    effect = {"id": "amplitude-damping", "choke": growth, "measure": "velocity", "power": power}
    played = Played(folder, BAR_M, damping=total(alpha_per_s=16.0), effects=[effect])
    k = played.bending(1)[0]
    f0 = played.freq_hz[k]
    own = 0.5 * (16.0 + 5e-9 * (2 * np.pi * f0) ** 2)
    assert played.decay_per_s[k] == pytest.approx(own, rel=1e-3)  # at no level, as `modes` lists it
    found = []
    for start in (0.015, 0.1, 0.3):
        _, decay, level = played.line(f0, start, start + 0.02)
        assert decay == pytest.approx(own * (1 + (growth * level * played.level(k)) ** power), rel=WITHIN)
        found.append(decay)
    assert found[0] > 1.2 * found[2]


def test_a_stiffness_that_depends_on_direction_is_heard(folder: Path) -> None:
    """Along a slender bar E is 1/S₁₁, whatever the other constants are: f goes as its root."""
    plain = load_material("steel")
    c = plain.stiffness_pa.copy()
    c[0, 0] *= 0.7
    isotropic = Played(folder, BAR_M, damping=total())
    rows = [list(map(float, row)) for row in c]
    tensor = {"youngs_pa": None, "poisson": None, "stiffness_pa": rows, "source": "made"}
    played = Played(folder, BAR_M, damping=total(), elasticity=tensor)
    ratio = np.sqrt(np.linalg.inv(plain.stiffness_pa)[0, 0] / np.linalg.inv(c)[0, 0])
    one, two = (p.line(p.freq_hz[p.bending(1)[0]])[0] for p in (isotropic, played))
    assert two / one == pytest.approx(ratio, rel=WITHIN)
    freq, decay, _ = played.line(played.freq_hz[0])
    assert decay == pytest.approx(0.5 * (4.0 + 5e-9 * (2 * np.pi * freq) ** 2), rel=WITHIN)


def test_loss_by_heat_is_in_the_sound(folder: Path) -> None:
    """A strip bends about one axis: its lowest mode loses what a beam loses, beside the material's own."""
    heat = next(one for one in load_material("aluminium").effects if one.id == "thermoelastic")
    played = Played(folder, STRIP_M, "aluminium")
    mode = played.freq_hz[0]
    own = 0.5 * np.array(load_material("aluminium").alpha_per_s)  # β is nothing at 160 Hz
    beam = np.pi * mode * heat.loss_of_beam(np.array(STRIP_M[2]), np.array(2 * np.pi * mode))
    assert played.line(mode, 0.05, 0.45)[1] == pytest.approx(own + beam, rel=WITHIN)
    assert beam > 2 * own


def test_every_effect_that_a_preset_can_hold_is_played_here() -> None:
    here = Path(__file__).read_text()
    assert len(KEPT_EFFECTS) >= 4
    assert all(f'"{kind.id}"' in here for kind in KEPT_EFFECTS if kind is not RecordedLines)
    assert Radiation not in KEPT_EFFECTS and all(kind.owner in (Owner.MATERIAL, Owner.OBJECT) for kind in KEPT_EFFECTS)
    assert Orthotropy.stage is Stage.MATERIAL  # what `diagnose` writes of it is the preset's own tensor
