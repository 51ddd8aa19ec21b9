"""The model with its effects, played on any strike.

    λ -> corrections -> d = ½(α + βλ) -> MODES -> A = g J (φ(p)·e)(φ(q)·n) · start -> Ring -> BANK -> hits and pulses ->
        SOUND -> samples

Every stage hands a value to the next, and effects of a stage act in the order in which they were found, those on a
sound in that of its path: what rings along with the body sounds in the room, and both through the chain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.effects.common.ringing import sounded
from sonic_bullet.effects.protocol import CARRIES, Effect, Impact, Mixing, Owner, Ring, RotatesPairs, Sound, Stage
from sonic_bullet.records import Array, ModalModel

OWNER_ORDER = tuple(Owner)  # material, object, fixture, striker, room, chain: a sound's
SAMPLED = 300  # vertices by which modes are compared
KEPT = 4  # hypotheses and bodies whose modes are remembered


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """α, β and gain σ of the case, and the effects in it. correction: by object, (m,) relative; absent: the mesh's own
    frequencies.

    stretch: ln of what all frequencies are multiplied with, as E/ρ is fitted again beside effects that move modes;
    poisson: ν, where it is; else the baseline's.
    """

    alpha_per_s: float
    beta_s: float
    gain: float
    effects: tuple[Effect, ...] = ()
    correction: dict[str, Array] | None = None
    stretch: float = 0.0
    poisson: float | None = None

    def at(self, stage: Stage, *, fitted: bool = True) -> tuple[Effect, ...]:
        """The effects of a stage; on an object that was not fitted only those that carry over."""
        mine = (e for e in self.effects if e.stage is stage and (fitted or e.owner in CARRIES))
        return tuple(sorted(mine, key=lambda e: OWNER_ORDER.index(e.owner)) if stage is Stage.SOUND else mine)


def ordered(
    model: ModalModel, freq_hz: Array, decay_per_s: Array, shape: Array | None = None
) -> tuple[ModalModel, Array]:
    """The model with other modes, ascending, and which mode (m,) went where; overdamped ones are gone."""
    good = np.flatnonzero((freq_hz > 0) & np.isfinite(freq_hz))
    order = good[np.argsort(freq_hz[good], kind="stable")]
    kept = model.shape if shape is None else shape
    if len(order) < len(freq_hz) or (np.diff(order) < 0).any():
        kept = kept[:, :, order]
    return replace(model, freq_hz=freq_hz[order], decay_per_s=np.maximum(decay_per_s[order], 0.0), shape=kept), order


def undamped(h: Hypothesis, body: Struck) -> ModalModel:
    """The body's model under the effects on its material, uncorrected."""
    effects = h.at(Stage.MATERIAL, fitted=body.recorded is not None)
    if not effects or body.elastic is None:
        return body.model if h.poisson is None or body.other is None else body.other(h.poisson)
    material = body.elastic.material
    for effect in effects:
        material = effect.apply(material)
    return body.elastic.solve(material.stiffness_pa / material.density_kg_m3)


def moves(h: Hypothesis) -> bool:
    """Whether an effect moves modes, so that lines are paired and corrections learnt anew."""
    return any(e.stage is Stage.MATERIAL or e.traits.moves_modes for e in h.effects)


def moves_itself(h: Hypothesis, effect: Effect) -> bool:
    """Whether an effect moves modes, whatever the others do."""
    return moves(replace(h, effects=(effect,)))


def mixes_neighbours(effect: Effect | type[Effect]) -> bool:
    """Whether modes take on their neighbours' shapes under it."""
    return effect.traits.mixing is Mixing.NEIGHBOURS


def bends(h: Hypothesis) -> bool:
    """Whether an effect acts on ringing modes, so that lines are not what linear ones leave."""
    return bool(h.at(Stage.BANK))


def mixes(h: Hypothesis) -> bool:
    """Whether an effect makes all modes anew out of the old ones."""
    return any(e.traits.mixing is Mixing.ALL for e in h.effects)


@lru_cache(maxsize=KEPT)
def modes_of(h: Hypothesis, body: Struck) -> tuple[ModalModel, Array]:
    """The body's damped modes under the hypothesis, and which uncorrected mode each was (m,).

    Remembered: every strike of a body asks.

    Corrections come before the effects; where these mix modes, after them, as they were learnt on what came of it.
    """
    base = undamped(h, body)
    none = np.zeros(base.mode_count)
    correction = (h.correction or {}).get(body.name, none)
    if len(correction) != len(none):  # learnt under another material
        correction = none
    last = mixes(h)
    lam = (2 * np.pi * base.freq_hz * (1 + (none if last else correction)) * np.exp(h.stretch)) ** 2
    decay = (h.alpha_per_s + h.beta_s * lam) / 2
    model, order = ordered(base, np.sqrt(np.maximum(lam - decay**2, 0)) / (2 * np.pi), decay)
    for effect in sorted(
        h.at(Stage.MODES, fitted=body.recorded is not None), key=lambda e: e.owner is not Owner.MATERIAL
    ):  # a law of the material is no fixture's
        before, model = model, effect.apply(model)
        if effect.traits.mixing is Mixing.NEIGHBOURS:
            order = order[came_from(before, model)]
    for effect in h.at(Stage.BANK, fitted=body.recorded is not None):
        if isinstance(effect, RotatesPairs):  # axes of degenerate pairs
            model = effect.turned(model)
    return (
        ordered(model, model.freq_hz * (1 + correction[: model.mode_count]), model.decay_per_s)
        if last
        else (model, order)
    )


def came_from(old: ModalModel, new: ModalModel) -> Array:
    """The old mode (m,) that each new one is most like, by their motion on the surface, one to one."""
    from scipy.optimize import linear_sum_assignment

    step = max(1, len(old.shape) // SAMPLED)
    a, b = (x.shape[::step].reshape(-1, x.mode_count).astype(float) for x in (old, new))
    return np.asarray(linear_sum_assignment(-np.abs(b.T @ a) / np.linalg.norm(a, axis=0))[1])


def pattern(body: Struck, model: ModalModel) -> Array:
    """J ψ (s, m), real, of the body's strikes at the sensor; J = 1 where it is not known."""
    at = model.shape[body.surface_count(model) :].astype(float)
    row = np.einsum("sxm,sx->sm", at, body.direction)
    level = np.where(np.isfinite(body.impulse_n_s), body.impulse_n_s, 1.0)
    return np.asarray(level[:, None] * row[:-1] * row[-1])


def in_band(body: Struck, model: ModalModel) -> Array:
    """1 for modes (m,) that a recording can hold, else 0."""
    return np.asarray((model.freq_hz >= body.band_hz[0]) & (model.freq_hz <= body.band_hz[1]), float)


def start(kind: str, model: ModalModel) -> Array:
    """Complex factor (m,) of the amplitude: the phase a mode starts with; see estimator.observe."""
    if kind == "velocity":
        return np.asarray(1 + 1j * model.decay_per_s / (2 * np.pi * model.freq_hz))
    return np.full(model.mode_count, -1j if kind in ("sum", "lines") else 1.0 + 0j)


def impact_of(h: Hypothesis, body: Struck, strike: int) -> Impact:
    """What the strike is under the hypothesis."""
    level = body.impulse_n_s[strike]
    impact = Impact(float(level) if np.isfinite(level) else 1.0, np.zeros(1), np.ones(1))
    for effect in h.at(Stage.FORCE, fitted=body.recorded is not None):
        impact = effect.apply(impact)
    return impact


def ring_of(h: Hypothesis, body: Struck, strike: int) -> Ring:
    """The modes as a strike starts them, before its pulse's spectrum; those outside the band are silent."""
    model, _ = modes_of(h, body)
    row = pattern(body, model)[strike] * in_band(body, model)
    push = np.einsum("xm,x->m", model.shape[body.surface_count(model) + strike].astype(float), body.direction[strike])
    most = np.ones(len(row))
    if any(e.stage is Stage.BANK for e in h.effects) and body.surface_count(model):
        most = np.sqrt((model.shape[: body.surface_count(model)].astype(float) ** 2).sum(axis=1)).max(axis=0)
    impact = impact_of(h, body, strike)
    none = np.zeros(len(row))
    ring = Ring(
        model.freq_hz,
        model.decay_per_s,
        h.gain * row * start(body.kind, model),
        np.abs(impact.impulse_n_s * push) * most,
        none,
        none,
        impact.impulse_n_s,
    )
    for effect in h.at(Stage.BANK, fitted=body.recorded is not None):
        ring = effect.apply(ring)
    return ring


def play(h: Hypothesis, body: Struck, strike: int, n: int, sr: int) -> Array:
    """The strike's sound (n,) from the onset on, in units of the file."""
    impact = impact_of(h, body, strike)
    sample = sounded(ring_of(h, body, strike), impact, n, sr)
    index = -1
    if body.recorded is not None:
        index = body.fitted.index(strike) if strike in body.fitted else -1
    sound = Sound(sample, sr, impact.impulse_n_s, index)
    for effect in h.at(Stage.SOUND, fitted=body.recorded is not None):
        sound = effect.apply(sound)
    return sound.sample
