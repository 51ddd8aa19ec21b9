"""Residuals in the run time: levels, places, seeds, blocks, joins, a thousand strikes, and what happens where there
is none.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from sonic_bullet.apps.cli import cli
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.residual.grains import (
    apply_gain,
    fade_window,
    make_voice,
    mixed_number,
    place_grains,
    response,
    vary_grains,
)
from sonic_bullet.engine.residual.player import (
    SECTION,
    FrictionHistory,
    Grain,
    add_grains,
    cut_rubbed_sections,
    section_grain,
    section_window,
)
from sonic_bullet.engine.runtime.replay import Synthesizer, render_log
from sonic_bullet.engine.runtime.residual_voice import build_residual_voice, struck_power
from sonic_bullet.files import read_audio, read_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Air, Material, Microphone, ModalSum
from sonic_bullet.records.contacts import Contacts
from tests.made.models import STEEL, box_body, row, step, wall_body
from tests.made.residuals import SR, modes, residual

FREQ = (400.0, 900.0, 1500.0, 2600.0, 4100.0, 6000.0)
IDLE_S = 0.02  # of the work in `slower`, nothing else running
EDGES_M = (0.2, 0.1, 0.01)
SOURCE = modes(FREQ, 10.0)
NOISY = replace(STEEL, residual=residual(SOURCE, lines=((1200.0, 8.0, 0.3), (2600.0, 3.0, 0.5))))
HERE, THERE = (0.03, 0.02, 0.005), (-0.08, 0.04, 0.005)


def struck(
    material: Material,
    impulses: dict[int, float],
    *,
    steps: int = 60,
    where: object = HERE,
    seed: int = 0,
    rubs: range = range(0),
) -> ContactLog:
    """A floating box struck by a silent wall in the steps named, and rubbed in others."""
    bodies = box_body(EDGES_M, FREQ, material), wall_body()

    def contacts(i: int) -> Contacts | None:
        if i in impulses:
            return row(0, 1, (0, 0, -impulses[i]), normal=(0, 0, -1), point_a=where)
        if i in rubs:
            return row(0, 1, (0, 0, -0.02), normal=(0, 0, -1), point_a=where, sweep=(0.3, 0.3), approach=0.0)
        return None

    made = tuple(step([(0, 0, 0), (0, 0, 0.01)], contacts(i)) for i in range(steps))
    return ContactLog(bodies, made, (Microphone([0, 0, 1.0]), ModalSum()), SR, seed)


def beside_sound(log: ContactLog) -> np.ndarray:
    """What the residual adds: sound with less sound without."""
    return render_log(log) - render_log(log, residual=False)


def test_without_a_residual_nothing_changes_and_with_one_something_sounds() -> None:
    plain = render_log(struck(STEEL, {2: 0.01}))
    assert (render_log(struck(NOISY, {2: 0.01}), residual=False) == plain).all()
    silenced = replace(struck(NOISY, {2: 0.01}), residual=False)
    assert (render_log(silenced) == plain).all() and (render_log(silenced, residual=True) != plain).any()
    more = beside_sound(struck(NOISY, {2: 0.01}))
    assert all(1e-3 < np.sqrt((m**2).mean() / (p**2).mean()) < 3 for m, p in zip(more, plain, strict=True))
    quiet = replace(STEEL, residual=residual(SOURCE, per_hz=0.0))
    assert (render_log(struck(quiet, {2: 0.01})) == plain).all()


def test_same_seed_same_bytes_other_seed_other_grains() -> None:
    log = struck(NOISY, {2: 0.01, 20: 0.02}, rubs=range(30, 50))
    first = render_log(log)
    assert (first == render_log(log)).all()
    other = render_log(replace(log, seed=1), residual=True)
    assert not (first == other).all()
    levels = [
        np.sqrt((beside_sound(one)[1, :8000] ** 2).mean())
        for one in (struck(NOISY, {2: 0.01}), struck(NOISY, {2: 0.01}, seed=1))
    ]
    assert levels[0] == pytest.approx(levels[1], rel=0.3)


def test_live_frames_a_sound_in_between_and_a_replay_are_the_same_bits(tmp_path: Path) -> None:
    """Asking for the sound midway changes nothing; the log brings its residual to disk and back; the whole is the
    frames.
    """
    log = struck(NOISY, {2: 0.01, 20: 0.02}, rubs=range(30, 50))
    live = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air)
    halfway = None
    for i, one in enumerate(log.steps):
        live.feed(one, log.bodies)
        if i in (3, 21, 40):
            halfway = live.sound()
    assert (live.sound() == render_log(log)).all()
    assert halfway is not None and halfway.any()
    log.save(tmp_path / "log.npz")
    again = read_log(tmp_path / "log.npz")
    kept = again.bodies[0].material
    assert kept is not None and kept.residual is not None
    assert (kept.residual.power_per_hz == NOISY.residual.power_per_hz).all()
    assert (render_log(again) == render_log(log)).all()
    for name, words, wanted in (
        ("with.wav", [], render_log(log)),
        ("without.wav", ["--no-residual"], render_log(log, residual=False)),
    ):
        done = CliRunner().invoke(
            cli, ["render", str(tmp_path / "log.npz"), "-o", str(tmp_path / name), "--tail", "0", *words]
        )
        assert done.exit_code == 0, done.output
        assert read_audio(str(tmp_path / name))[0] == pytest.approx(wanted, rel=1e-6, abs=1e-12)


def test_level_follows_the_impulse() -> None:
    """The residual at twice the impulse is as much louder as the modes are (softer blows press longer: both fall
    alike).
    """
    soft, loud = (struck(NOISY, {2: j}, where=HERE) for j in (0.01, 0.02))
    modal = [np.sqrt((render_log(log, residual=False)[1] ** 2).mean()) for log in (soft, loud)]
    more = [np.sqrt((beside_sound(log)[1] ** 2).mean()) for log in (soft, loud)]
    assert more[1] / more[0] == pytest.approx(modal[1] / modal[0], rel=0.15)
    assert 1.8 < modal[1] / modal[0] < 2.6


def test_the_place_decides_as_it_does_for_the_modes() -> None:
    """A body's a² at two places differ by the modes' shapes; a grain of a place is that response, in steps of 2 dB."""
    body = box_body(EDGES_M, FREQ, NOISY)
    resonator = build_resonator(body, (ModalSum(),), SR, Air())
    beside = build_residual_voice(resonator, SR, Air())
    assert beside is not None and body.model is not None
    for face in (0, 5):
        corners = resonator.shape[body.model.face[face]].astype(float)
        modal_impulse = np.einsum("c,cxm,x->m", [0.2, 0.3, 0.5], corners, [0.0, 0.0, 0.01])
        power = struck_power(beside, resonator.weight[1], modal_impulse)
        assert power == pytest.approx(np.abs(resonator.weight[1] * modal_impulse) ** 2, rel=1e-9)
        pair, level = place_grains(beside.voice, power, 20e-6, False, lambda f_tau, _: np.ones(len(f_tau)))
        exact = apply_gain(beside.voice, response(beside.voice, power))
        assert 10 * abs(np.log10((level**2 * (pair.astype(float) ** 2).sum()) / (exact.astype(float) ** 2).sum())) < 1.0
        # from the cache: the pulse is not asked again
        assert (place_grains(beside.voice, 4 * power, 20e-6, False, lambda f_tau, _: 0 * f_tau)[0] == pair).all()


def test_any_cut_of_the_calls_gives_the_same_bits() -> None:
    """Grains and rubbing, in one call and in ragged ones."""
    voice = make_voice(residual(SOURCE, per_hz=1e-6), SOURCE, SR)
    random = np.random.default_rng(4)
    n = 9000
    force = random.normal(size=n)
    power = np.ones(len(FREQ))
    outs = []
    for cuts in ([n], [1, 255, 256, 700, 3000, 11, n], [400] * 30):
        out, at, state, grains = np.zeros((1, 1, n)), 0, None, ()
        grains = (Grain(100, 0, 0, np.full(5000, 0.1, np.float32)), Grain(700, 0, 0, np.full(300, 1 / 3, np.float32)))
        for cut in cuts:
            size = min(cut, n - at)
            sections, state = cut_rubbed_sections(state, force[at : at + size], at, size)
            grains = (
                *grains,
                *(Grain((j + 2) * SECTION, 0, 0, section_grain(voice, f, power, j)) for j, f in sections),
            )
            grains = add_grains(out[:, :, at : at + size], grains, at)
            at += size
        outs.append(out)
    assert outs[0].any()
    assert all((out == outs[0]).all() for out in outs[1:])


def test_rubbing_is_carried_by_grains_of_which_no_two_are_alike() -> None:
    """Sections add to the force in power; their grains are as loud, and differ, and a force that ends is played to its
    end.
    """
    assert section_window()[:SECTION] ** 2 + section_window()[SECTION:] ** 2 == pytest.approx(1.0, abs=1e-12)
    voice = make_voice(residual(SOURCE, per_hz=1e-6), SOURCE, SR)
    force = np.random.default_rng(4).normal(size=2 * SECTION) * section_window()
    grains = np.array([section_grain(voice, force, np.ones(len(FREQ)), j) for j in range(40)], float)
    level = np.sqrt((grains**2).mean(axis=1))
    assert level.std() / level.mean() < 0.15
    alike = np.corrcoef(grains) - np.eye(40)
    assert np.abs(alike).max() < 0.8
    assert np.abs(alike).mean() < 0.2
    more, state = cut_rubbed_sections(FrictionHistory(0, np.ones(600), np.ones(1)), None, 600, 3000)
    assert [j for j, _ in more] == [0, 1]
    assert state is None
    quiet = section_grain(voice, 1e-9 * force, np.ones(len(FREQ)), 0)
    assert len(quiet) == 0  # far below hearing


def second_difference(x: np.ndarray) -> np.ndarray:
    return np.abs(np.diff(x, 2)) ** 2


def test_no_click_where_grains_join() -> None:
    """Steady rubbing: the second difference at the joins of sections is, root mean square over 4000 joins, at most 1.01
    times that elsewhere.

    Strikes: a steady residual begins and ends without a larger second difference than it has in its middle.
    """
    steady = residual(SOURCE, per_hz=1e-6, decay_per_s=0.0, last_s=0.1)
    voice = make_voice(steady, SOURCE, SR, 0.05)
    random = np.random.default_rng(8)
    count = 4000
    force = random.normal(size=(count + 2) * SECTION)
    out = np.zeros((count + 8) * SECTION + voice.length)
    for j in range(count):
        grain = section_grain(voice, force[j * SECTION : (j + 2) * SECTION] * section_window(), np.ones(len(FREQ)), j)
        out[j * SECTION : j * SECTION + len(grain)] += grain
    middle = out[40 * SECTION : (count - 40) * SECTION]
    bent = second_difference(middle)[: len(middle) // SECTION * SECTION - SECTION].reshape(-1, SECTION)
    at_join = np.sqrt(bent[:, [-2, -1, 0, 1]].mean())
    elsewhere = np.sqrt(bent[:, 32:-32].mean())
    assert at_join / elsewhere <= 1.01
    pair = apply_gain(voice, np.ones(257))
    shape = fade_window(voice.length, SR)
    assert shape[0] < 0.02 and shape[-1] < 1e-3
    edges, inner = [], []
    for j in range(300):
        sound = np.concatenate([np.zeros(8), vary_grains(pair, 1.0, mixed_number(j)), np.zeros(8)])
        bent = second_difference(sound)
        edges.append(np.concatenate([bent[:16], bent[-16:]]))
        inner.append(bent[400 : int(0.8 * len(bent))])
    assert np.sqrt(np.mean(edges)) <= 1.01 * np.sqrt(np.mean(inner))


def test_a_thousand_strikes_stay_real_time() -> None:
    """1000 strikes at many places within 4.2 s of sound take less processor time than that, all in, the residual's
    share below a half of it.
    """
    random = np.random.default_rng(2)
    bodies = box_body(EDGES_M, FREQ, NOISY), wall_body()
    silent = box_body(EDGES_M, FREQ, STEEL), wall_body()
    steps = []
    for i in range(1010):
        place = (*random.uniform((-0.09, -0.045), (0.09, 0.045)), 0.005)
        steps.append(
            step(
                [(0, 0, 0), (0, 0, 0.01)],
                row(0, 1, (0, 0, -0.01), normal=(0, 0, -1), point_a=place) if i % 6 == 2 else None,
            )
        )
    log = ContactLog(bodies, tuple(steps), (Microphone([0, 0, 1.0]),), SR, 0)
    render_log(struck(NOISY, {2: 0.01}))

    def spent(which: ContactLog) -> float:
        begun = time.thread_time()
        render_log(which)
        return time.thread_time() - begun

    strikes = len(range(2, 1010, 6))
    # the least of three: what else runs on a machine only ever adds
    assert any(1000 * (spent(log) - spent(replace(log, bodies=silent))) / strikes < 4.2 * slower() for _ in range(3))


def slower() -> float:
    """How much slower than an idle machine this one is now, 1 or more: tests run side by side share caches
    and cores.
    """
    x, times = np.random.default_rng(0).standard_normal(2**18), []
    for _ in range(5):
        begun = time.thread_time()
        np.fft.rfft(x)
        sum(i * i for i in range(200_000))
        times.append(time.thread_time() - begun)
    return max(1.0, min(times) / IDLE_S)


def test_a_body_without_modes_or_with_a_far_off_residual_plays_plain() -> None:
    """No modes: nothing to follow. A residual of far higher modes than the body has: finite."""
    far = replace(STEEL, residual=residual(modes(np.linspace(9000, 20_000, 30), 400.0)))
    log = struck(far, {2: 0.01})
    assert np.isfinite(render_log(log)).all()
    still = replace(box_body(EDGES_M, FREQ, NOISY), model=None)
    mute = replace(log, bodies=(still, log.bodies[1]))
    assert (render_log(mute) == render_log(mute, residual=False)).all()
    for sr in (8000, 44_100, 96_000):
        assert np.isfinite(render_log(struck(NOISY, {2: 0.01}, steps=30), sr=sr)).all()
