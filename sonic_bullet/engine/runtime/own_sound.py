"""Sound of one contact alone, without what else its bodies ring with at that time.

    strike: PULSE + Uᵀj -> p(t) = Σ Re(w a e^{s t}) / r,   a = share Uᵀj |F̂(fτ)| (1 + i d/ω)
        + the rigid body's click
    friction: force of a step on modes at rest before the pair's first -> p(t), its energy

The closed form of the bank, with its poles and weights as they are in that step; r from the body's centre,
as in the path [bank.resonator explains the click]. Not included: noise of residuals, and transmission to a partner.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sonic_bullet._engine import SPECTRUM_CELLS_PER_F_TAU
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.engine.contact.pulse_shape import interpolate_impulse, spectrum_table
from sonic_bullet.engine.runtime.synthesis_state import State
from sonic_bullet.records import Array, Microphone


class _Voice(NamedTuple):
    """A body as a row of modes, its motion towards the microphone the last.

    pole, weight over distance, response to a unit of impulse; and the direction and distance.
    """

    pole: Array
    weight: Array
    onset: Array
    toward: Array
    away_m: float


class OwnSound:
    """Sound of a log's contacts at its first microphone, step by step; friction rings on between its steps."""

    def __init__(self, microphone: Microphone, sound_speed_m_s: float) -> None:
        self._place_m, self._speed_m_s = np.asarray(microphone.position_m, float), sound_speed_m_s
        self._friction: dict[tuple[int, int], tuple[int, Array]] = {}  # step, and state, of a pair's side

    def strike_pa(self, state: State, number: int, at: int, frames: int) -> Array:
        """Compute the pressure (frames,) of pulse ``at`` of a step, from its first arrival on, of both bodies.

        number: of the step in which it strikes.
        """
        pulse, sr = state.scratch.pulse[at], state.bank.sr
        flat, length_s = int(pulse["flat"]), float(pulse["length_s"])
        voices = [self._voice(state, int(b), number) for b in pulse["body"]]
        nearest_m = min(voice.away_m for voice in voices)
        edges = np.arange(int(np.ceil(length_s * sr)) + 1) / (length_s * sr)
        force = np.diff(interpolate_impulse(edges, flat=bool(flat)))
        total = np.zeros(frames)
        for side, voice in enumerate(voices):
            modes = len(voice.pole) - 1
            shape = _spectrum(np.angle(voice.pole[:modes]) * sr / (2 * np.pi) * length_s, flat)
            modal_impulse = float(pulse["transmitted_fraction"]) * state.scratch.modal_impulse[at, side, :modes]
            late = round((voice.away_m - nearest_m) / self._speed_m_s * sr)
            sound = _free(
                voice.pole[:modes], voice.weight[:modes] * voice.onset[:modes] * modal_impulse * shape, frames - late
            )
            rigid_impulse = (
                (1 - 2 * side) * float(pulse["transmitted_fraction"]) * float(pulse["impulse_n_s"] @ voice.toward)
            )
            click = _free(voice.pole[modes:], voice.weight[modes:] * voice.onset[modes:] * rigid_impulse, frames - late)
            total[late:] += sound + np.convolve(click, force)[: frames - late]
        return total

    def friction_pa2(self, state: State, number: int, drives: int, frames: int) -> dict[int, float]:
        """Sum p² over a step's samples of each pair with friction, by its place among the pairs."""
        found, scratch, sr = {}, state.scratch, state.bank.sr
        for d in range(drives):
            force = scratch.force[d * frames : (d + 1) * frames] / sr
            total = np.zeros(frames)
            for side, b in enumerate(scratch.body[d].tolist()):
                if b < 0:
                    continue
                voice = self._voice(state, b, number)
                modes = len(voice.pole) - 1
                gain = 0.5 * (scratch.gain0[d, side, :modes] + scratch.gain1[d, side, :modes])
                direction = 0.5 * (scratch.direction0[d] + scratch.direction1[d])
                gain = np.append(gain, (1 - 2 * side) * float(direction @ voice.toward)) * voice.onset
                key = (int(state.pairs.pair["key"][scratch.slot[d]]), int(state.body[b]))
                last, z = self._friction.get(key, (number, np.zeros(0)))
                if len(z) != len(gain) or number - last > SPAN:
                    z = np.zeros(len(gain), complex)
                powers = voice.pole[:, None] ** np.arange(frames)
                answer = (voice.weight * gain) @ powers
                answer[0] -= (voice.weight * gain / (1 - voice.pole))[:modes].sum()  # what lasts sends nothing
                total += np.convolve(answer.real, force)[:frames] + ((voice.weight * voice.pole * z) @ powers).real
                self._friction[key] = (
                    number,
                    voice.pole**frames * z + gain * (powers[:, ::-1] @ force),
                )
            found[int(scratch.slot[d])] = float(total @ total)
        return found

    def _voice(self, state: State, b: int, number: int) -> _Voice:
        bank, ringing, window = state.bank.body[b], state.ringing, state.window
        lanes, modes = slice(int(bank["start"]), int(bank["start"]) + int(bank["columns"])), len(ringing.pole) // 2
        toward = self._place_m - window.position_m[number % SPAN, b]
        away_m = max(float(np.linalg.norm(toward)), state.resonators[b].radius_m, 1e-6)

        def complex_of(flat: Array) -> Array:
            return flat[:modes][lanes] + 1j * flat[modes:][lanes]

        rigid = bool(bank["rigid"])
        end = (
            complex(*bank["rigid_pole"]) if rigid else 0j,
            float(bank["rigid_weight"]) if rigid else 0.0,
            complex(*bank["rigid_onset"]) if rigid else 0j,
        )
        weight = np.append(complex_of(state.bank.weight[0]), end[1]) / away_m
        return _Voice(
            np.append(complex_of(ringing.pole), end[0]),
            weight,
            np.append(1 + 1j * ringing.law[2, lanes], end[2]),
            toward / max(float(np.linalg.norm(toward)), 1e-12),
            away_m,
        )


def _spectrum(f_tau: Array, flat: int) -> Array:
    row = spectrum_table()[flat]
    return np.asarray(np.interp(np.abs(f_tau), np.arange(len(row)) / SPECTRUM_CELLS_PER_F_TAU, row, right=0.0))


def _free(pole: Array, amplitude: Array, frames: int) -> Array:
    """Compute Re Σ amplitude · poleⁿ (frames,)."""
    group = 64  # Samples whose powers of the poles are computed once
    if frames <= 0 or not len(pole):
        return np.zeros(max(frames, 0))
    near, far = np.arange(group), np.arange(-(-frames // group))
    with np.errstate(under="ignore"):
        steps: Any = (amplitude[:, None] * (pole[:, None] ** group) ** far).T @ pole[:, None] ** near
    return np.asarray(steps.real.ravel()[:frames])
