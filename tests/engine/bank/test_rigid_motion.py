"""Sensors on a surface: F/m of free and of jointed bodies, d/dt, a clamped bar, the same bits everywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps.soundtrack.stems import render_stems
from sonic_bullet.engine.bank.rigid_motion import LOWEST_HZ
from sonic_bullet.engine.contact.pulse_shape import pulse_spectrum
from sonic_bullet.engine.path.surface.sensor_chain import DIFFERENTIATOR_TAPS, differentiator
from sonic_bullet.engine.runtime.replay import render_blocks, render_log
from sonic_bullet.files import read_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.modal import analyse
from sonic_bullet.records import Array, Body, ContactMicrophone, Microphone, Shape, Vibrometer
from sonic_bullet.records.modal_options import ModalOptions
from tests.engine.runtime.test_render_sensors import DATED_M, SR, Pulse, one_strike, only_pulse, rendered
from tests.made.jointed import FAR_HZ, LENGTH_M, TAPPED_M, held_transfer, tapped_arm, transfer_per_kg
from tests.made.models import STEEL, box_body, row, wall_body

EDGES_M = (0.2, 0.1, 0.02)
IMPULSE_N_S = 0.01


def struck(body: Body, sensors: tuple[Any, ...], where: tuple[float, float, float], steps: int = 24) -> Array:
    """A body struck along -z at a place by a wall."""
    contacts = row(0, 1, (0, 0, -IMPULSE_N_S), normal=(0, 0, -1), point_a=where, approach=1.0, gap=DATED_M)
    bodies = body, wall_body()
    return rendered(bodies, one_strike(bodies, contacts, [(0, 0, 0), where], steps=steps), sensors)


def pulse_on(body: Body, where: tuple[float, float, float]) -> Pulse:
    return only_pulse(
        body, row(0, 1, (0, 0, -IMPULSE_N_S), normal=(0, 0, -1), point_a=where, approach=1.0, gap=DATED_M)
    )


@pytest.mark.parametrize(
    ("where", "point", "along"),
    [
        ((0.0, 0.0, 0.01), (0.03, 0.02, 0.01), (0, 0, -1)),
        ((0.08, 0.03, 0.01), (-0.07, 0.04, 0.01), (0, 0, 1)),
        ((0.08, 0.03, 0.01), (0.1, -0.05, -0.01), (0.3, 0.9, 0.2)),
    ],
)
def test_a_free_body_moves_by_its_impulse_and_moment(where: Any, point: Any, along: Any) -> None:
    """Without a mode in the band v = n·(J/m + (I⁻¹ (r×J))×q), times e^{-dt}(cos dt - sin dt) of the high-pass."""
    body = box_body(EDGES_M, FAR_HZ)
    (heard,) = struck(body, (Vibrometer(0, point, along),), where)
    impulse, n = np.array([0, 0, -IMPULSE_N_S]), np.array(along) / np.linalg.norm(along)
    spin = np.linalg.solve(body.inertia_kg_m2, np.cross(where, impulse))
    speed = n @ (impulse / body.mass_kg + np.cross(spin, point))
    pulse, rate = pulse_on(body, where), np.sqrt(2) * np.pi * LOWEST_HZ
    time = np.arange(heard.size) / SR - 2 / 240 - pulse.start_s - pulse.length_s / 2
    expected = speed * np.exp(-rate * time) * (np.cos(rate * time) - np.sin(rate * time))
    late = slice(450, None)
    assert np.abs(heard[late] - expected[late]).max() < 0.002 * abs(speed)
    assert not heard[:390].any()


def test_a_contact_microphone_gives_the_force_by_the_effective_mass() -> None:
    """Its acceleration is F(t)/m*: spectrum J·|F̂|/m, from 40 Hz to 4 kHz, 7.5 samples after the force."""
    body, where = box_body(EDGES_M, FAR_HZ), (0.05, 0.0, 0.01)
    (heard,) = struck(body, (ContactMicrophone(0, where, (0, 0, -1)),), where, steps=60)
    per_kg = 1 / body.mass_kg + where[0] ** 2 / body.inertia_kg_m2[1, 1]
    pulse, size = pulse_on(body, where), 1 << 15
    f, measured = np.fft.rfftfreq(size, 1 / SR), np.fft.rfft(heard, size) / SR
    band = (f > 40) & (f < 4000)
    f, measured = f[band], measured[band]
    rate = np.sqrt(2) * 2j * np.pi * f / (2 * np.pi * LOWEST_HZ)
    high_pass = -((f / LOWEST_HZ) ** 2) / (1 - (f / LOWEST_HZ) ** 2 + rate)
    law = IMPULSE_N_S * per_kg * pulse_spectrum(f * pulse.length_s, flat=pulse.flat) * high_pass
    at_s = 2 / 240 + pulse.start_s + pulse.length_s / 2 + (DIFFERENTIATOR_TAPS - 1) / 2 / SR
    error = measured * np.exp(2j * np.pi * f * at_s) / law - 1
    print(f"pulse {pulse.length_s * 1e6:.0f} µs, error to 4 kHz {np.abs(error).max():.4f}")
    assert np.abs(error).max() < 0.01


def test_the_derivative_is_exact_in_the_band() -> None:
    taps = differentiator(SR)
    omega = np.linspace(0.005, 0.84, 200) * np.pi
    response = (
        np.exp(-1j * omega[:, None] * np.arange(DIFFERENTIATOR_TAPS))
        @ taps
        * np.exp(1j * omega * (DIFFERENTIATOR_TAPS - 1) / 2)
    )
    assert np.abs(response / (1j * omega * SR) - 1).max() < 2e-3


def test_a_fixed_body_and_another_body_do_not_move() -> None:
    still = box_body(EDGES_M, FAR_HZ, mass_kg=0.0)
    assert not struck(still, (Vibrometer(0, (0, 0, 0.01), (0, 0, 1)),), (0, 0, 0.01)).any()
    free = box_body(EDGES_M, FAR_HZ)
    assert not struck(free, (Vibrometer(7, (0, 0, 0.01), (0, 0, 1)),), (0, 0, 0.01)).any()
    assert not struck(replace(free, silent=True), (Vibrometer(0, (0, 0, 0.01), (0, 0, 1)),), (0, 0, 0.01)).any()


# --- a bar held at one end

BAR_M = (0.24, 0.012, 0.004)
ROOTS = np.array([1.8751041, 4.6940911, 7.8547574])


def clamped_shape(x: Array) -> Array:
    """Euler-Bernoulli shapes (x, 3) of a bar clamped at 0 and free at 1, mean square 1 [Blevins 1979, table 8-1]."""
    z = ROOTS * np.asarray(x)[:, None]
    ratio = (np.sinh(ROOTS) - np.sin(ROOTS)) / (np.cosh(ROOTS) + np.cos(ROOTS))
    return np.asarray(np.cosh(z) - np.cos(z) - ratio * (np.sinh(z) - np.sin(z)))


@pytest.fixture(scope="module")
def bar() -> Body:
    """A steel bar, all nodes of whose end at -x are clamped."""
    options = ModalOptions(to_hz=2500, accuracy=0.003, fixed=[(-BAR_M[0] / 2 - 1.0, 0, 0, 1.0001)])
    model = analyse((Shape("box", np.array(BAR_M)),), STEEL, to_hz=2500, accuracy=0.003, fixed=options.fixed)
    mass = STEEL.density_kg_m3 * float(np.prod(BAR_M))
    return Body(0, -1, 0, "bar", mass, np.eye(3) * 1e-4, model.volume_m3, material=STEEL, model=model, options=options)


def test_a_bar_held_at_one_end_is_the_closed_form_along_its_length(bar: Body) -> None:
    """Tapped at the tip: a = Σ J F̂ φ(tip)φ(x) ω sin ωt e^{-dt}: f within 1 %, levels along it as well."""
    half, top = BAR_M[0] / 2, BAR_M[2] / 2
    along = np.array([1.0, 0.85, 0.7, 0.5, 0.3])
    ears = tuple(ContactMicrophone(0, (x * BAR_M[0] - half, 0, top), (0, 0, -1)) for x in along)
    tip = (half, 0.0, top)
    heard = struck(bar, ears, tip, steps=100)
    material, model = bar.material, bar.model
    assert material is not None and model is not None
    youngs = 1 / np.linalg.inv(material.stiffness_pa)[0, 0]
    law_hz = ROOTS**2 / (2 * np.pi * BAR_M[0] ** 2) * np.sqrt(youngs * BAR_M[2] ** 2 / 12 / material.density_kg_m3)
    pulse = pulse_on(bar, tip)
    time = (
        np.arange(heard.shape[1]) / SR
        - 2 / 240
        - pulse.start_s
        - pulse.length_s / 2
        - (DIFFERENTIATOR_TAPS - 1) / 2 / SR
    )
    late = slice(600, None)
    kept = np.flatnonzero(model.freq_hz < 2400)
    pole = -model.decay_per_s[kept] + 2j * np.pi * model.freq_hz[kept]
    wave = np.exp(pole[:, None] * time[late])
    found = np.linalg.lstsq(np.concatenate([wave.real, wave.imag]).T, heard[:, late].T, rcond=None)[0]
    level = np.hypot(found[: len(kept)], found[len(kept) :])
    shape = clamped_shape(along)
    for k, hz in enumerate(law_hz):
        nearest = int(np.argmin(np.abs(model.freq_hz[kept] - hz)))
        assert model.freq_hz[kept][nearest] == pytest.approx(hz, rel=0.01)
        gain = pulse_spectrum(np.array([hz * pulse.length_s]), flat=pulse.flat)[0] * pulse.share * IMPULSE_N_S
        law = np.abs(gain * 2 * np.pi * hz * shape[:, k] * shape[0, k] / bar.mass_kg)
        print(f"{hz:.1f} Hz: {model.freq_hz[kept][nearest]:.1f}, {(level[nearest] / law.max()).round(4)}")
        assert np.abs(level[nearest] - law).max() < 0.01 * law.max()


# --- links and joints


@pytest.fixture
def arm(client: Any) -> sb.Listener:
    tip = Vibrometer(0, (LENGTH_M[1] / 2, 0.01, 0), (0, 1, 0), 1)
    return tapped_arm(client, (tip, ContactMicrophone(0, (0, 0.01, 0), (0, 1, 0), 0), Microphone([0.2, 0.3, 0.1])))


def test_a_link_moves_by_the_effective_mass_of_its_arm(arm: sb.Listener) -> None:
    """The tapped link's end, and through the hinge the middle of the other link: J M⁻¹ Jᵀ within 2 %."""
    log, heard = arm.contacts, arm.sound()
    impulse = float(log.rows.impulse_n_s[:, 1].sum())
    (l1, l2) = LENGTH_M
    tapped = l1 + l2 / 2 + TAPPED_M, l2 / 2 + TAPPED_M
    tip, middle = transfer_per_kg(tapped, (l1 + l2, l2)), transfer_per_kg(tapped, (l1 / 2, 0.0))
    at = int(np.argmax(np.abs(heard[0]) > 0.5 * np.abs(heard[0]).max()))  # the middle of the pulse
    gone = 12 / SR * np.sqrt(2) * np.pi * LOWEST_HZ
    step = heard[0, at + 12] / np.exp(-gone) / (np.cos(gone) - np.sin(gone))
    f = np.fft.rfftfreq(1 << 14, 1 / SR)
    band = (f > 60) & (f < 400)
    passed = np.abs(np.fft.rfft(heard[1], 1 << 14))[band].mean() / SR
    print(f"{impulse:.4f} N·s: tip {step / impulse / tip:.4f}, middle {passed / impulse / middle:.4f}")
    assert step == pytest.approx(impulse * tip, rel=0.02)
    assert passed == pytest.approx(impulse * abs(middle), rel=0.02)
    free = 1 / 0.5 + (TAPPED_M * l2 / 2) / (0.5 * (l2**2 + 0.02**2) / 12)
    assert abs(free / tip - 1) > 0.15  # the link by itself would be another


def test_joints_with_springs_swing_as_the_closed_form(client: Any, tmp_path: Path) -> None:
    """Two links, a spring with a loss in either hinge: jω J (K − ω²M)⁻¹ Jᵀ of the tip within 2 %, from 30 to 400 Hz."""
    springs = {0: (2e4, 0.06), 1: (8e3, 0.06)}
    tip = Vibrometer(0, (LENGTH_M[1] / 2, 0.01, 0), (0, 1, 0), 1)
    listener = tapped_arm(client, tip, steps=160, springs=springs)
    log, heard = listener.contacts, listener.sound()[0]
    impulse, (l1, l2) = float(log.rows.impulse_n_s[:, 1].sum()), LENGTH_M
    n = 1 << 16
    f = np.fft.rfftfreq(n, 1 / SR)
    band = (f > 30) & (f < 400)
    complex_k = np.array([k * (1 + 1j * loss) for k, loss in springs.values()])
    law = held_transfer(f[band], (l1 + l2 / 2 + TAPPED_M, l2 / 2 + TAPPED_M), (l1 + l2, l2), complex_k)
    high_pass = 1 / np.sqrt(1 + (LOWEST_HZ / f[band]) ** 4)
    found = np.abs(np.fft.rfft(heard, n))[band] / SR / impulse
    off = np.abs(found - np.abs(law) * high_pass).max() / np.abs(law).max()
    print(f"{off:.4f} of the largest")
    assert off < 0.02
    assert np.array_equal(render_log(log)[0], heard)
    log.save(tmp_path / "held.npz")
    assert np.array_equal(render_log(read_log(tmp_path / "held.npz"))[0], heard)
    assert np.array_equal(np.concatenate([*render_blocks(log)], axis=1)[0], heard)


def test_live_blocks_replay_and_file_are_the_same_bits(arm: sb.Listener, tmp_path: Path) -> None:
    log, live = arm.contacts, arm.sound()
    assert (np.abs(live).max(axis=1) > 0).all() and log.steps[23].motions.size == 0
    assert np.array_equal(render_log(log), live)
    assert np.array_equal(np.concatenate([*render_blocks(log)], axis=1), live)
    log.save(tmp_path / "arm.npz")
    assert np.array_equal(render_log(read_log(tmp_path / "arm.npz")), live)
    by_one = ContactLog(log.bodies, tuple(log.steps), log.sensors, log.sr, log.seed, log.air)
    assert np.array_equal(render_log(by_one), live)
    apart = sum(stem.sound.samples() for stem in render_stems(log))
    assert np.abs(apart - live).max() <= 1e-9 * np.abs(live).max()


def test_a_quench_stops_it(client: Any) -> None:
    listener = tapped_arm(client, ContactMicrophone(0, (0, 0.01, 0), (0, 1, 0), 1), steps=4)
    listener.quench()
    for _ in range(8):
        client.stepSimulation()
    sound = listener.sound()
    assert np.abs(sound[:, :800]).max() > 0 and not sound[:, 800:].any()
    assert np.array_equal(render_log(listener.contacts), sound)
