"""What does standing on something do to the table-top? Levels before and after, T60s with their shares, clicks.

python studies/table_top.py [--only levels shares rod clicks] [--picture docs/explanation/pictures/table-top.png]

levels   the loudest 50 ms over those 1.5 s after the last strike, hung as in air and in place, and whose sound it is
shares   T60 of each body's modes once all lies still: free, in place, and what takes it: itself, contact, roughness,
         board; how often it rang louder than its contacts' law holds
rod      a steel rod alone on a wooden board: its level 3 s after it fell
clicks   a bowl that rocks to rest: rms of the second difference within 1 ms of new poles over that of 20 ms around
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


import sonic_bullet as sb
from benchmarks.load_leaps import find_leaps
from sonic_bullet.engine.bank.layout import BLOCK
from sonic_bullet.engine.contact.coupling import Region, contact_spring
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.replay import Synthesizer, render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array
from sonic_bullet.scene import render_scene
from sonic_bullet.simulators import direct_client, disconnect

ROOT = Path(__file__).resolve().parents[1]
WINDOW_S, AFTER_S = 0.05, 1.5
DT = 1 / 240


def level_db(samples: Array, sr: int) -> Array:
    """DB SPL of each 50 ms, mean over channels."""
    n = round(WINDOW_S * sr)
    blocks = samples[:, : samples.shape[1] // n * n].reshape(len(samples), -1, n)
    return np.asarray(10 * np.log10((blocks**2).mean(axis=(0, 2)) / 4e-10 + 1e-12))


def played(log: ContactLog, until_s: float) -> Synthesizer:
    """The state of a log's sound after so many seconds."""
    synth = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air, supports=log.supports, keep=False)
    for step in log.steps[: round(until_s / DT)]:
        synth.play([step], log.bodies)
    return synth


def ringing_db(synth: Synthesizer, b: int) -> Array:
    """(m,) dB SPL at 1 m of each mode of a body, as it rings now."""
    state = synth._state
    lanes = slice(int(state.bank.body["start"][b]), int(state.bank.body["start"][b] + state.resonators[b].mode_count))
    z = state.ringing.z.reshape(2, -1)[:, lanes]
    rms = np.hypot(*z) * np.abs(state.resonators[b].weight[0]) / np.sqrt(2)
    return np.asarray(20 * np.log10(np.maximum(rms, 1e-15) / 2e-5))


def t60_s(decay: Array) -> Array:
    return np.asarray(np.log(1000) / np.maximum(decay, 1e-9))


def now_per_s(synth: Synthesizer, b: int) -> Array:
    """(m,) decays of a body's modes as they are now."""
    state, m = synth._state, synth._state.resonators[b].mode_count
    start = int(state.bank.body["start"][b])
    return np.asarray(-state.ringing.law[0, start : start + m] * state.bank.sr)


def rough_share(state: Any, b: int, load_n: Array) -> float:
    """Share of the contacts' compliance that is roughness, mean over a body's touches."""
    sides = state.resonators[b].side, state.resonators[0].side
    smooth = replace(sides[0], roughness_m=0.0), replace(sides[1], roughness_m=0.0)
    bare = [Region((0.0, 0.0), (1 / 0.005, 1 / 0.005))] * len(load_n)
    ratio = [
        1 - contact_spring(r, sides, n).normal_n_m.real / contact_spring(r, smooth, n).normal_n_m.real
        for r, n in zip(bare, load_n.tolist(), strict=True)
    ]
    return float(np.mean(ratio))


def levels(log: ContactLog, sounds: dict[str, Array]) -> Iterator[str]:
    last_s = float(find_leaps(log).strike_s.max())
    at = round((last_s + AFTER_S) / WINDOW_S)
    for name, samples in sounds.items():
        level = level_db(samples, log.sr)
        yield (
            f"{name}: loudest 50 ms {level.max():.0f} dB, {AFTER_S} s after the last strike (at {last_s:.2f} s) "
            f"{level[at]:.0f} dB: {level.max() - level[at]:.0f} dB below"
        )
    synth = played(log, last_s + AFTER_S)
    whose = []
    for b, one in enumerate(synth._state.resonators):
        if one.mode_count:
            power = 10 * np.log10(np.sum(10 ** (ringing_db(synth, b) / 10)))
            k = int(ringing_db(synth, b).argmax())
            if power > 0:
                free, now = t60_s(one.decay_per_s[k]), t60_s(now_per_s(synth, b)[k])
                hz = one.omega_rad_s[k] / 2 / np.pi
                material = one.body.material.name if one.body.material else ""
                whose.append(
                    (power, f"{one.body.name} ({material}) {power:.0f} dB, {hz:.0f} Hz: T60 {free:.1f} -> {now:.1f}")
                )
    yield from ("    " + line for _, line in sorted(whose, reverse=True)[:4])


def shares(log: ContactLog, until_s: float = 4.9) -> Iterator[str]:
    synth = played(log, until_s)
    state = synth._state
    turned = state.window.quaternion_xyzw[(state.number - 1) % SPAN]
    for b, one in enumerate(state.resonators):
        if one.body.mass_kg <= 0 or not one.mode_count:
            continue
        load, _, _, decay_per_s, shares_per_s, *_ = state.engine().couple_body(b, turned)
        if not len(load):
            continue
        rang, lifted = synth.separations.get(one.body.name, (0, 0))
        rough = rough_share(state, b, load)
        free, now = t60_s(one.decay_per_s), t60_s(decay_per_s)
        part = shares_per_s / decay_per_s[:, None]
        material = one.body.material.name if one.body.material else ""
        yield (
            f"{one.body.name} ({material}), {len(load)} points, {load.sum():.2f} N, roughness {rough:.0%} of what the "
            f"contacts yield, {lifted} of {rang} steps beyond the law"
        )
        for k in np.flatnonzero(one.omega_rad_s < 2 * np.pi * 15e3)[:8]:
            own, contact, board = part[k]
            yield (
                f"    {one.omega_rad_s[k] / 2 / np.pi:7.0f} Hz  T60 {free[k]:6.2f} -> {now[k]:6.2f} s  own {own:4.0%}  "
                f"contact {contact * (1 - rough):4.0%}  roughness {contact * rough:4.0%}  board {board:4.0%}"
            )


def fallen(shape: Any, height_m: float, turn: Any, seconds: float, mass_kg: float, supported: bool = True) -> Any:
    """A steel body that falls on a wooden board; the listener."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    board = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.45, 0.3, 0.012])
    table = client.createMultiBody(0, board, basePosition=[0, 0, -0.012])
    body = client.createMultiBody(
        mass_kg, client.createCollisionShape(**shape), basePosition=[0, 0, height_m],
        baseOrientation=client.getQuaternionFromEuler(turn),
    )  # fmt: skip
    for one in (table, body):
        client.changeDynamics(one, -1, restitution=0.6, rollingFriction=1e-4)
    sb.keep_restitution(client)
    listener = sb.attach(client, microphone=(0, -0.7, 0.5), supports=supported)
    listener.add_all({table: {"material": "wood", "count": 120}, body: "steel"})
    for _ in range(round(seconds / DT)):
        client.stepSimulation()
    return client, listener


def rod() -> Iterator[str]:
    shape = {"shapeType": 4, "radius": 0.006, "height": 0.16}
    for supported in (False, True):
        client, listener = fallen(shape, 0.05, (0, 1.2, 0.3), 4.0, 7850 * np.pi * 0.006**2 * 0.16, supported)
        level = level_db(listener.sound(), listener.sr)
        last = float(find_leaps(listener.contacts).strike_s.max())
        at = round((last + 1.5) / WINDOW_S)
        yield (
            f"rod alone, {'in place' if supported else 'hung'}: below its loudest by {level.max() - level[at]:.0f} dB "
            f"1.5 s after its last strike (at {last:.2f} s), {level.max() - level[-1]:.0f} dB after 4 s"
        )
        disconnect(client)


def clicks() -> Iterator[str]:
    """Changes that lie apart from strikes; the sound at the microphone is 2.5 ms late, at every change alike."""
    made: list[int] = []
    updates = 0

    def look(state: Any, *_: Any) -> None:
        nonlocal updates
        so_far = int(state.support_state["updates"].sum())
        if so_far > updates:
            made.append(state.ringing.at)
        updates = so_far

    shape = {"shapeType": 5, "fileName": str(ROOT / "assets" / "bowl.obj")}
    client, listener = fallen(shape, 0.06, (0.5, 0.2, 0), 5.0, 7850 * 75.1e-6)
    for _ in render_per_body(listener.contacts, observer=look):
        pass
    sound, sr, struck = listener.sound()[0], listener.sr, find_leaps(listener.contacts).strike_s
    disconnect(client)
    travel = round(np.hypot(0.7, 0.5) / 343 * sr)
    starts = np.unique([-(-at // BLOCK) * BLOCK for at in made]) + travel
    bend = np.diff(sound, 2)
    ratio = []
    for at in starts:
        near, wide = round(1e-3 * sr), round(1e-2 * sr)
        if (
            at + wide >= len(bend)
            or at < wide
            or np.min(np.abs(struck * sr + travel - at), initial=np.inf) < 1.5 * wide
        ):
            continue
        ratio.append(np.sqrt(np.mean(bend[at - near : at + near] ** 2) / np.mean(bend[at - wide : at + wide] ** 2)))
    yield (
        f"clicks: {len(ratio)} changes of poles apart from strikes, of {len(starts)}: rms of the second difference "
        f"over that around: median {np.median(ratio):.3f}, highest {np.max(ratio):.3f}"
    )


def picture(path: str, log: ContactLog, sounds: dict[str, Array]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(3, 1, figsize=(9, 8), height_ratios=(2, 2, 1.4), layout="constrained")
    for axis, (name, samples) in zip(axes, sounds.items(), strict=False):
        axis.specgram(samples[0], NFFT=2048, Fs=log.sr, noverlap=1024, vmin=-150, vmax=-40, cmap="magma")
        axis.set(title=name, ylabel="Hz", ylim=(0, 12_000))
        axes[2].plot(np.arange(len(level_db(samples, log.sr))) * WINDOW_S, level_db(samples, log.sr), label=name)
    axes[2].set(xlabel="s", ylabel="dB SPL, 50 ms", xlim=(0, log.duration_s), ylim=(60, 120))
    axes[2].legend(loc="upper right")
    figure.savefig(path, dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parts = ("levels", "shares", "rod", "clicks")
    parser.add_argument("--only", nargs="*", choices=parts, default=list(parts))
    parser.add_argument("--picture", metavar="FILE")
    asked = parser.parse_args()
    lines: list[Iterator[str]] = []
    if {"levels", "shares"} & set(asked.only) or asked.picture:
        result = render_scene(ROOT / "scenes" / "tabletop.py")
        sounds = {"hung in air": render_log(replace(result.log, supports=False)), "in place": result.samples}
        lines += [levels(result.log, sounds)] * ("levels" in asked.only)
        lines += [shares(result.log)] * ("shares" in asked.only)
        if asked.picture:
            picture(asked.picture, result.log, sounds)
    lines += [rod()] * ("rod" in asked.only) + [clicks()] * ("clicks" in asked.only)
    for part in lines:
        for line in part:
            print(line, flush=True)


if __name__ == "__main__":
    main()
