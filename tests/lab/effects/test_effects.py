"""What every effect must keep, and that each finds itself in what it did."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest

from sonic_bullet.effects import EFFECTS, Effect, Impact, Ring, Sound, Stage
from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.common.pulses import spectrum
from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.presets_of_effects import effect_of, to_preset
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.records import Material
from sonic_bullet.records.errors import RecordError
from tests.made.body import SR, plate, struck, truth

PULSES = ("half-sine", "hertz", "raised-cosine")

SPOT = (0.05, 0.04, 0.0)
STRONG: dict[type[Effect], tuple[Effect, Effect]] = {  # at work, and without strength
    DampingLaw: (DampingLaw("power", 2e-3, 1.4), DampingLaw("constant-loss", 0.0)),
    SupportDamping: (SupportDamping((SPOT,), (4.0,)), SupportDamping((SPOT,), (0.0,))),
    ContactTime: (ContactTime(2e-4, 0.01), ContactTime(0.0, 0.01)),
    ModeSplitting: (ModeSplitting((1053.6,), (5e-3,), (0.4,)), ModeSplitting((1053.6,), (0.0,), (0.0,))),
    AmplitudePitch: (AmplitudePitch(0.5), AmplitudePitch(0.0)),
    AmplitudeDamping: (AmplitudeDamping(3.0, "velocity"), AmplitudeDamping(0.0)),
    Room: (Room(0.5, 0.6, 3), Room(0.5, 0.0, 3)),
    ForeignMode: (ForeignMode((700.0,), (9.0,), (0.5,), (0.2,)), ForeignMode((700.0,), (9.0,), (0.0,), (0.2,))),
    AddedMass: (AddedMass(SPOT, 0.02), AddedMass(SPOT, 0.0)),
    Rebound: (Rebound(0.02, 0.01, 0.5), Rebound(0.02, 0.01, 0.0)),
    Radiation: (Radiation(0.05, 1.0), Radiation(0.05, 0.0)),
    MeasurementChain: (MeasurementChain(high_pass_hz=300.0, limit=0.4), MeasurementChain()),
}
MEMBERS = [kind for kind in EFFECTS if kind in STRONG]


def given(stage: Stage) -> Any:
    """A value of the stage."""
    if stage is Stage.MATERIAL:
        return Material.isotropic("glass", youngs_pa=7e10, poisson=0.22, density_kg_m3=2500)
    if stage is Stage.MODES:
        return predict(truth(), struck()).model
    if stage is Stage.FORCE:
        return Impact(0.02, np.zeros(1), np.ones(1))
    if stage is Stage.BANK:
        m = np.arange(1.0, 6.0)
        return Ring(400 * m, 5 * m, 0.1 * m + 0.05j, 0.02 * m, 0 * m, 0 * m, 0.02)
    return Sound(np.random.default_rng(1).standard_normal(4000) * np.exp(-np.arange(4000) / 900), SR, 0.02)


def arrays(x: Any) -> dict[str, Any]:
    """A value's fields by name; arrays copied."""
    return {
        f.name: np.array(getattr(x, f.name)) if isinstance(getattr(x, f.name), np.ndarray) else getattr(x, f.name)
        for f in fields(x)
    }


def same(a: Any, b: Any, rtol: float = 1e-6) -> bool:
    """Whether two stage values agree."""
    one, two = arrays(a), arrays(b)
    return all(
        np.allclose(one[k], two[k], rtol=rtol, atol=1e-9)
        if isinstance(one[k], np.ndarray)
        else one[k] == two[k] or k == "pulse"
        for k in one
    )


def test_every_member_has_its_example() -> None:
    # that one has a file of its own
    missing = {kind.id for kind in EFFECTS} - {kind.id for kind in STRONG} - {"orthotropy"}
    assert missing == set() and MEMBERS


@pytest.mark.parametrize("kind", MEMBERS, ids=lambda k: k.id)
def test_contract(kind: type[Effect]) -> None:
    strong, none = STRONG[kind]
    x = given(kind.stage)
    before = arrays(x)
    once, twice = strong.apply(x), strong.apply(x)
    assert same(x, type(x)(**before)), "the input is left alone"
    assert all(
        np.array_equal(arrays(once)[k], arrays(twice)[k]) if isinstance(v, np.ndarray) else arrays(twice)[k] == v
        for k, v in arrays(once).items()
    )
    assert not same(x, once), "an effect of some strength does something"
    assert same(x, none.apply(x)), "one of none does nothing"
    assert kind.reference and kind.__doc__ and strong.freedom() >= 1
    json.dumps(strong.parameters(), allow_nan=False)
    with pytest.raises((FrozenInstanceError, AttributeError)):
        strong.id = "other"  # type: ignore[misc]
    if kind.stage is Stage.SOUND:
        silent = Sound(np.zeros(4000), SR, 0.0)
        assert not strong.apply(silent).sample.any(), "silence stays silence"


@pytest.mark.parametrize("kind", [Room, ForeignMode, MeasurementChain], ids=lambda k: k.id)
def test_sound_effects_agree_between_rates(kind: type[Effect]) -> None:
    strong = replace(STRONG[kind][0], limit=0.0) if kind is MeasurementChain else STRONG[kind][0]  # type: ignore[type-var]
    levels = []
    for sr in (44_100, 48_000):
        t = np.arange(sr // 2) / sr
        x = np.exp(-20 * t) * np.sin(2 * np.pi * 900 * t)
        y = strong.apply(Sound(x, sr, 0.02)).sample
        levels.append((np.sqrt((y**2).mean()), np.sqrt((y[sr // 4 :] ** 2).mean())))
    # a room's noise is another at another rate; its law is the same
    assert np.allclose(levels[0], levels[1], rtol=0.35 if kind is Room else 5e-3)


@pytest.mark.parametrize("pulse", PULSES)
def test_a_pulse_is_its_own_integral(pulse: str) -> None:
    tau, count = 3e-4, 20_001
    x = (np.arange(count) + 0.5) / count
    wave = {
        "half-sine": np.sin(np.pi * x),
        "hertz": np.sin(np.pi * x) ** 1.5,
        "raised-cosine": 1 - np.cos(2 * np.pi * x),
    }[pulse]
    wave /= wave.sum()
    freq = np.array([0.0, 500.0, 2000.0, 5000.0, 9000.0])
    told = np.array([(wave * np.exp(-2j * np.pi * f * tau * x)).sum() for f in freq])
    assert np.allclose(spectrum(pulse, tau, freq), told, atol=2e-6)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_bent_mode_is_the_equation_solved(power: float) -> None:
    """Against 4th-order Runge-Kutta of ȧ = −d a(1 + (c a)^p), θ̇ = ω(1 + b a²)."""
    f, d, level, bend, damping_growth, sr, n = 300.0, 8.0, 0.4, 0.05, 1.7, 8000, 4000
    one = np.ones(1)
    ring = Ring(
        f * one,
        d * one,
        0.7 * one.astype(complex),
        level * one,
        bend * one,
        damping_growth * one,
        damping_growth_power=power,
    )
    got = synthesize_ring(ring, Impact(1.0, np.zeros(1), one), n, sr)

    def slope(state: Any) -> Any:
        a = state[0]
        return np.array([-d * a * (1 + (damping_growth * a) ** power), 2 * np.pi * f * (1 + bend * a * a)])

    state, step, made = np.array([level, 0.0]), 1 / sr / 4, []
    for i in range(4 * n):
        if i % 4 == 0:
            made.append(0.7 * state[0] / level * np.cos(state[1]))
        k1 = slope(state)
        k2 = slope(state + step / 2 * k1)
        k3 = slope(state + step / 2 * k2)
        k4 = slope(state + step * k3)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert np.abs(got - np.array(made)).max() < 1e-6


def test_added_mass_is_rayleighs_to_first_order() -> None:
    x = given(Stage.MODES)
    m = 1e-6
    moved = AddedMass(SPOT, m).apply(x)
    vertex = int(np.argmin(((plate().vertex_m[:345] - np.array(SPOT)) ** 2).sum(axis=1)))
    told = -m * (x.shape[vertex].astype(float) ** 2).sum(axis=0)
    assert np.allclose(moved.omega0_squared_per_s2 / x.omega0_squared_per_s2 - 1, told, atol=1e-3 * np.abs(told).max())


def test_support_damping_adds_half_c_phi_squared() -> None:
    x = given(Stage.MODES)
    vertex = int(np.argmin(((plate().vertex_m[:345] - np.array(SPOT)) ** 2).sum(axis=1)))
    added = SupportDamping((SPOT,), (0.01,)).apply(x).decay_per_s - x.decay_per_s
    assert np.allclose(added, 0.005 * x.shape[vertex, 2].astype(float) ** 2, rtol=2e-3, atol=1e-6)


def test_stored_and_read_back() -> None:
    count = 0
    for strong, _ in STRONG.values():
        try:
            back = (
                effect_of(json.loads(json.dumps(to_preset(strong))))
                if strong.id in ("damping-law", "mode-splitting", "amplitude-pitch", "amplitude-damping")
                else None
            )
        except RecordError as error:
            raise AssertionError(strong.id) from error
        if back is not None:
            assert to_preset(back) == to_preset(strong)
            assert repr(back) == repr(strong)
            count += 1
    assert count == 4
    with pytest.raises(RecordError, match="room"):
        effect_of({"id": "room", "rt60_s": 1.0})
    with pytest.raises(RecordError, match="damping-law"):
        effect_of({"id": "damping-law", "law": "power", "eta": "much"})


@pytest.mark.parametrize(
    ("data", "field"),
    [
        ({"id": "damping-law", "law": "viscous", "eta": 0.1}, "law"),
        ({"id": "damping-law", "law": "constant-loss", "eta": -0.1}, "eta"),
        ({"id": "mode-splitting", "freq_hz": [100.0], "split": [0.01, 0.02], "turn_rad": [0.1]}, "split holds 2"),
        ({"id": "amplitude-pitch", "bend": 1.0, "measure": "loudness"}, "measure"),
        ({"id": "amplitude-pitch", "bend": 1.0, "freq_hz": [100.0], "turn_rad": []}, "turn_rad holds 0"),
        ({"id": "amplitude-damping", "choke": -1.0}, "choke"),
        ({"id": "amplitude-damping", "choke": 1.0, "power": 1.5}, "power"),
    ],
    ids=lambda x: x["id"] if isinstance(x, dict) else x,
)
def test_numbers_that_no_body_has_are_refused_by_the_fields_name(data: dict[str, Any], field: str) -> None:
    with pytest.raises(RecordError, match=field):
        effect_of(data)
