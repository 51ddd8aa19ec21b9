"""A channel of a recording is the hammer's force: the case gets impulses in N·s, and a fit uses them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet import modal
from sonic_bullet.files.presets import load_material
from sonic_bullet.lab.lines.hammer_pulse import measure_pulse
from sonic_bullet.records import Array
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few
from tests.made.case import sound, write_box

SR = 48_000
IMPULSE_N_S, CONTACT_S, NEWTON = 0.1, 4e-4, 500.0
BAR_M = (0.14, 0.03, 0.005)


def half_sine(at_s: float, count: int, impulse_n_s: float = IMPULSE_N_S, contact_s: float = CONTACT_S) -> Array:
    """Newton: J π/(2τ) sin(π t/τ), whose integral is J."""
    t = np.arange(count) / SR - at_s
    inside = (t > 0) & (t < contact_s)
    return np.where(inside, impulse_n_s * np.pi / (2 * contact_s) * np.sin(np.pi * t / contact_s), 0.0)


def ring(force: Array) -> Array:
    """What a struck thing sounds like: the force through three damped sinusoids."""
    t = np.arange(len(force)) / SR
    body = sum(np.exp(-d * t) * np.sin(2 * np.pi * f * t) for f, d in ((1680, 8), (2900, 12), (3360, 25)))
    size = 2 * len(force)
    made = np.fft.irfft(np.fft.rfft(force, size) * np.fft.rfft(body, size), size)[: len(force)]
    return np.asarray(0.3 * made / np.abs(made).max())


def noise(count: int, level: float, seed: int) -> Array:
    return level * np.random.default_rng(seed).standard_normal(count)


def write(name: str, force: Array, heard: Array | None = None, first: bool = False, subtype: str = "PCM_24") -> None:
    """A recording of sound and force, each over its noise."""
    heard = ring(np.abs(force)) if heard is None else heard
    both = [heard + noise(len(force), 1e-5, 1), force / NEWTON + 0.01 + noise(len(force), 1e-4, 2)]
    soundfile.write(name, np.stack(both[::-1] if first else both, axis=1), SR, subtype=subtype)


def strikes(*words: str) -> list[dict[str, Any]]:
    assert run("case", "new", "mine", "--material", "steel", *words) == 0
    return [entry["strike"] for entry in json.loads(Path("mine/case.json").read_text())["recordings"]]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SONIC_BULLET_PROGRESS", "0")


@parametrize_few(("impulse", "contact_s"), [(0.1, 4e-4), (0.01, 2e-4), (0.3, 2e-3)], 1)
def test_the_impulse_is_read_off_the_force(impulse: float, contact_s: float, capfd: pytest.CaptureFixture[str]) -> None:
    write("a.wav", half_sine(0.1003, SR // 2, impulse, contact_s))
    (strike,) = strikes("a.wav", "--force-channel", "1", "--force-newton", "500")
    assert strike["impulse"] == pytest.approx(impulse, rel=0.01)
    assert strike["force"] == {"file": "a-force.wav", "channel": 0, "newton_per_unit": 500}
    kept, heard = (soundfile.read(f"mine/a-{name}.wav", always_2d=True)[0] for name in ("force", "sound"))
    assert kept.shape == heard.shape == (SR // 2, 1)
    assert 500 * (kept - np.median(kept)).max() == pytest.approx(np.pi * impulse / 2 / contact_s, rel=0.05)
    assert f"{1000 * contact_s:.1g}" in capfd.readouterr().out
    assert run("case", "check", "mine") == 0 and run("fit", "mine", "-o", "p.json") == 0


def test_each_take_of_a_long_recording_has_its_impulse(capfd: pytest.CaptureFixture[str]) -> None:
    force = sum(half_sine(at, 3 * SR, j) for at, j in ((0.2, 0.02), (1.1, 0.05), (2.0, 0.1)))
    write("long.wav", np.asarray(force), first=True)
    found = strikes("long.wav", "--split", "--force-channel", "0", "--force-newton", "500")
    assert [s["impulse"] for s in found] == pytest.approx([0.02, 0.05, 0.1], rel=0.01)
    assert [s["force"]["file"] for s in found] == [f"long-0{k}-force.wav" for k in (1, 2, 3)]


def test_without_a_scale_no_impulse_is_made_up(capfd: pytest.CaptureFixture[str]) -> None:
    write("a.wav", half_sine(0.1, SR // 2))
    (strike,) = strikes("a.wav", "--force-channel", "1")
    assert strike["impulse"] is None and strike["force"]["newton_per_unit"] is None
    row = capfd.readouterr().out.splitlines()[1].split()
    assert row[2] == "s" and float(row[1]) == pytest.approx(IMPULSE_N_S / NEWTON, rel=0.01)


@pytest.mark.parametrize(
    ("change", "said", "impulse"),
    [
        (lambda f: -f, "upside down: turned", IMPULSE_N_S),
        (lambda f: np.minimum(f, 0.6 * f.max()), "saturated", None),
        (lambda f: f + 0.5 * np.roll(f, SR // 100), "2 hits: impulse not taken", None),
        (lambda f: f + 0.3 * np.roll(f, SR // 500) + 0.3 * np.roll(f, SR // 50), "3 hits: impulse not taken", None),
        (lambda f: -np.minimum(f, 0.8 * f.max()), "upside down: turned; saturated", None),
    ],
    ids=["upside down", "saturated", "double", "triple", "upside down and saturated"],
)
def test_a_force_that_is_odd_is_said(
    change: Any, said: str, impulse: float | None, capfd: pytest.CaptureFixture[str]
) -> None:
    force = half_sine(0.1003, SR // 2)
    heard = np.stack([ring(force) + noise(len(force), 1e-5, 1), change(force) / NEWTON], axis=1)
    soundfile.write("a.wav", heard, SR, subtype="PCM_24")
    (strike,) = strikes("a.wav", "--force-channel", "1", "--force-newton", "500")
    assert said in capfd.readouterr().out
    assert strike["impulse"] is None if impulse is None else strike["impulse"] == pytest.approx(impulse, rel=0.01)


@pytest.mark.parametrize("split", [(), ("--split",)])
@pytest.mark.parametrize(
    ("force", "words", "said"),
    [
        (np.zeros(SR // 2), ("--force-channel", "1"), "channel 1 of a.wav"),
        (noise(SR // 2, 1e-3, 5), ("--force-channel", "1"), "channel 1 of a.wav holds no force"),
        (half_sine(0.1, SR // 2), ("--force-channel", "2"), "a.wav has no channel 2"),
        (half_sine(0.1, SR // 2), ("--force-newton", "500"), "without --force-channel"),
        (half_sine(0.1, SR // 2), ("--force-channel", "1", "--force-newton", "-1"), "--force-newton is -1"),
        (None, ("--force-channel", "0"), "a.wav has 1 channel"),
    ],
    ids=["dead", "noise", "no such channel", "newton alone", "negative", "mono"],
)
def test_a_force_that_is_none_is_one_line(
    force: Array | None, words: tuple[str, ...], said: str, split: tuple[str, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    heard = ring(half_sine(0.1, SR // 2))
    parts = [heard] if force is None else [heard, force / NEWTON]
    soundfile.write("a.wav", np.stack(parts, axis=1), SR, subtype="FLOAT")
    assert run("case", "new", "mine", "a.wav", *words, *split) == 2
    line = capfd.readouterr().err.strip().splitlines()
    assert len(line) == 1 and said in line[0] and ";" in line[0] and not Path("mine").exists()


def test_sixteen_bits_are_no_saturation() -> None:
    soft = half_sine(0.1, SR // 2, 0.1, 5e-3)
    pulse = measure_pulse(np.round(soft / soft.max() * 2000) / 2**15, SR)
    assert pulse is not None and (pulse.flat, pulse.hits, pulse.turned) == (0, 1, False)
    assert pulse.contact_s == pytest.approx(5e-3, rel=0.01)


def test_a_fit_takes_the_recorded_impulse() -> None:
    """A steel bar's velocity at a known gain: the gain is found from what the hammer's force says."""
    gain, steel = 2e-3, load_material("steel")
    write_box(Path("bar.obj"), BAR_M)
    model = modal.analyse((modal.read_mesh(Path("bar.obj")),), steel, to_hz=12_000)
    top = np.flatnonzero(model.vertex_m[:, 2] > BAR_M[2] / 2 - 1e-9)
    end = int(top[np.argmax(model.vertex_m[top] @ (1.0, 0.7, 0))])
    places, impulses = top[[3, 17, 40]], (0.1, 0.05, 0.08)
    up = np.array([0, 0, 1.0])
    for i, (p, impulse) in enumerate(zip(places, impulses, strict=True)):
        heard = np.zeros(SR // 2)
        heard[4800:] = gain * sound(model, model.decay_per_s, (int(p), end), (-up, up), impulse, SR // 2 - 4800, SR)
        write(f"s{i}.wav", half_sine(0.1, SR // 2, impulse), heard, subtype="FLOAT")
    at = ",".join(f"{x:.9g}" for x in model.vertex_m[end])
    words = ("--mesh", "bar.obj", "--sensor", "velocity", f"--sensor-at={at}", "--sensor-direction=0,0,1")
    force = ("--medium", "none", "--force-channel", "1", "--force-newton", "500")
    strikes("s0.wav", "s1.wav", "s2.wav", *words, *force)
    case = json.loads(Path("mine/case.json").read_text())
    for entry, p in zip(case["recordings"], places, strict=True):
        entry["strike"] |= {"position": [float(x) for x in model.vertex_m[p]], "direction": [0, 0, -1]}
    sigma = []
    for _ in range(2):
        Path("mine/case.json").write_text(json.dumps(case))
        assert run("fit", "mine", "-o", "p.json", "--json", "fit.json") == 0
        sigma.append(json.loads(Path("fit.json").read_text())["sigma"])
        case["recordings"][1]["strike"]["impulse"] = None  # as of one that was saturated
    assert sigma[1] == pytest.approx(sigma[0], rel=0.01)
    assert sigma[0] == pytest.approx(gain, rel=0.02)  # the onset, which the fit has to find, adds its own per cent
