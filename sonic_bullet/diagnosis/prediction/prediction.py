"""What a hypothesis says of a body: its modes, and how it rings and sounds under any strike. Made once, and handed on.

    λ -> corrections -> d = ½(α + βλ) -> MODES -> A = g J (φ(p)·e)(φ(q)·n) · start -> Ring -> BANK -> hits and pulses ->
        SOUND -> samples

Every stage hands a value to the next. Modes are all strikes', so they are worked out when a prediction is made; what
one strike makes of them is worked out when it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis, mixes
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.effects.common.ringing import sounded
from sonic_bullet.effects.protocol import (
    Effect,
    Impact,
    Mixing,
    ObjectEvidence,
    Owner,
    Ring,
    RotatesPairs,
    Sound,
    Stage,
)
from sonic_bullet.records import Array, ModalModel

SAMPLED = 300  # vertices by which modes are compared


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """A hypothesis on one body. base: undamped, uncorrected. model: damped, with all that acts on modes. order (m,):
    which mode of base each of model's was.
    """

    hypothesis: Hypothesis
    body: Struck
    base: ModalModel
    model: ModalModel
    order: Array

    def acting(self, stage: Stage) -> tuple[Effect, ...]:
        """The effects of a stage that act on this body."""
        return self.hypothesis.at(stage, fitted=self.body.recorded is not None)

    def uncorrected(self) -> Prediction:
        """The same with the mesh's own frequencies; itself where the body has no corrections."""
        h = self.hypothesis
        known = self.body.name in (h.correction or {})
        return predict(replace(h, correction=None), self.body) if known else self

    def strikes_of(self, one: ObjectEvidence) -> list[int]:
        """Which of the body's strikes the evidence is of."""
        fitted = self.body.fitted
        return [fitted[i] for i in one.strike]

    def pattern(self) -> Array:
        """J ψ (s, m) of its modes; see the function."""
        return pattern(self.body, self.model)

    def start(self, strikes: list[int]) -> Array:
        """Complex factors (s, m) of the amplitudes of some strikes: the phases that modes start with."""
        own = self.body.own_phase
        if own is None:
            return np.tile(start(self.body.kind, self.model), (len(strikes), 1))
        return np.asarray(own[strikes][:, self.order])

    def impact(self, strike: int) -> Impact:
        """What the strike is."""
        return impact_of(float(self.body.level_n_s[strike]), self.acting(Stage.FORCE))

    def ring(self, strike: int) -> Ring:
        """The modes as a strike starts them, before its pulse's spectrum; those outside the band are silent."""
        body, model, count = self.body, self.model, self.body.surface_count(self.model)
        row = self.pattern()[strike] * in_band(body, model)
        push = np.einsum("xm,x->m", model.shape[count + strike].astype(float), body.direction[strike])
        most = np.ones(len(row))
        if self.hypothesis.at(Stage.BANK) and count:
            most = np.sqrt((model.shape[:count].astype(float) ** 2).sum(axis=1)).max(axis=0)
        impact = self.impact(strike)
        none = np.zeros(len(row))
        ring = Ring(
            model.freq_hz,
            model.decay_per_s,
            self.hypothesis.gain * row * self.start([strike])[0],
            np.abs(impact.impulse_n_s * push) * most,
            none,
            none,
            impact.impulse_n_s,
        )
        for effect in self.acting(Stage.BANK):
            ring = effect.apply(ring)
        return ring

    def sound(self, strike: int, n: int, sr: int) -> Array:
        """The strike's sound (n,) from the onset on, in units of the file."""
        impact = self.impact(strike)
        sample = sounded(self.ring(strike), impact, n, sr)
        index = -1
        if self.body.recorded is not None:
            index = self.body.fitted.index(strike) if strike in self.body.fitted else -1
        sound = Sound(sample, sr, impact.impulse_n_s, index)
        for effect in self.acting(Stage.SOUND):
            sound = effect.apply(sound)
        return sound.sample

    def sounds(self, strikes: Iterable[int], n: int, sr: int) -> Array:
        """Those of several strikes (s, n)."""
        return np.stack([self.sound(strike, n, sr) for strike in strikes])


Predictions = Mapping[Struck, Prediction]  # one hypothesis on several bodies


def predict_each(h: Hypothesis, bodies: Iterable[Struck]) -> Predictions:
    """What a hypothesis says of every body, once each."""
    return {body: predict(h, body) for body in dict.fromkeys(bodies)}


def predict_fitted(h: Hypothesis, bodies: Iterable[Struck]) -> Predictions:
    """The same of those bodies that were fitted."""
    return predict_each(h, (body for body in bodies if body.recorded is not None))


def predict(h: Hypothesis, body: Struck) -> Prediction:
    """What a hypothesis says of a body.

    Corrections come before the effects; where these mix modes, after them, as they were learnt on what came of it.
    """
    base, fitted = undamped(h, body), body.recorded is not None
    none = np.zeros(base.mode_count)
    correction = (h.correction or {}).get(body.name, none)
    if len(correction) != len(none):  # learnt under another material
        correction = none
    last = mixes(h)
    lam = (2 * np.pi * base.freq_hz * (1 + (none if last else correction)) * np.exp(h.stretch)) ** 2
    decay = (h.alpha_per_s + h.beta_s * lam) / 2 if body.own_decay_per_s is None else body.own_decay_per_s
    model, order = ordered(base, np.sqrt(np.maximum(lam - decay**2, 0)) / (2 * np.pi), decay)
    for effect in sorted(
        h.at(Stage.MODES, fitted=fitted), key=lambda e: e.owner is not Owner.MATERIAL
    ):  # a law of the material is no fixture's
        before, model = model, effect.apply(model)
        if effect.traits.mixing is Mixing.NEIGHBOURS:
            order = order[came_from(before, model)]
    for effect in h.at(Stage.BANK, fitted=fitted):
        if isinstance(effect, RotatesPairs):  # axes of degenerate pairs
            model = effect.turned(model)
    if last:
        model, order = ordered(model, model.freq_hz * (1 + correction[: model.mode_count]), model.decay_per_s)
    return Prediction(h, body, base, model, order)


def impact_of(impulse_n_s: float, effects: Iterable[Effect]) -> Impact:
    """A strike under the effects on its force."""
    impact = Impact(impulse_n_s, np.zeros(1), np.ones(1))
    for effect in effects:
        impact = effect.apply(impact)
    return impact


def undamped(h: Hypothesis, body: Struck) -> ModalModel:
    """The body's model under the effects on its material, uncorrected."""
    effects = h.at(Stage.MATERIAL, fitted=body.recorded is not None)
    if not effects or body.elastic is None:
        return body.model if h.poisson is None or body.other is None else body.other(h.poisson)
    material = body.elastic.material
    for effect in effects:
        material = effect.apply(material)
    return body.elastic.solve(material.stiffness_pa / material.density_kg_m3)


def ordered(model: ModalModel, freq_hz: Array, decay_per_s: Array) -> tuple[ModalModel, Array]:
    """The model with other modes, ascending, and which mode (m,) went where; overdamped ones are gone."""
    good = np.flatnonzero((freq_hz > 0) & np.isfinite(freq_hz))
    order = good[np.argsort(freq_hz[good], kind="stable")]
    kept = model.shape
    if len(order) < len(freq_hz) or (np.diff(order) < 0).any():
        kept = kept[:, :, order]
    return replace(model, freq_hz=freq_hz[order], decay_per_s=np.maximum(decay_per_s[order], 0.0), shape=kept), order


def came_from(old: ModalModel, new: ModalModel) -> Array:
    """The old mode (m,) that each new one is most like, by their motion on the surface, one to one."""
    from scipy.optimize import linear_sum_assignment

    step = max(1, len(old.shape) // SAMPLED)
    a, b = (x.shape[::step].reshape(-1, x.mode_count).astype(float) for x in (old, new))
    return np.asarray(linear_sum_assignment(-np.abs(b.T @ a) / np.linalg.norm(a, axis=0))[1])


def pattern(body: Struck, model: ModalModel) -> Array:
    """J ψ (s, m), real, of the body's strikes at the sensor; J about 1 where it is not known."""
    at = model.shape[body.surface_count(model) :].astype(float)
    row = np.einsum("sxm,sx->sm", at, body.direction)
    return np.asarray(body.level_n_s[:, None] * row[:-1] * row[-1])


def in_band(body: Struck, model: ModalModel) -> Array:
    """1 for modes (m,) that a recording can hold, else 0."""
    return np.asarray((model.freq_hz >= body.band_hz[0]) & (model.freq_hz <= body.band_hz[1]), float)


def start(kind: str, model: ModalModel) -> Array:
    """Complex factor (m,) of the amplitude: the phase a mode starts with; see estimator.observe."""
    if kind == "velocity":
        return np.asarray(1 + 1j * model.decay_per_s / (2 * np.pi * model.freq_hz))
    return np.full(model.mode_count, -1j if kind in ("sum", "lines") else 1.0 + 0j)
