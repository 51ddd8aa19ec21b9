"""Prediction of a body by a hypothesis: its modes, and their vibration and sound under any strike.

    λ -> corrections -> d = ½(α + βλ) -> MODES -> A = g J (φ(p)·e)(φ(q)·n) · start -> Ring -> BANK -> hits and pulses ->
        SOUND -> samples

Every stage hands a value to the next. Modes are common to all strikes, so they are computed when a prediction is made;
what depends on one strike is computed when it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.effects.common.mode_matching import match_all
from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.protocol import Effect, Impact, Mixing, Owner, Ring, RotatesPairs, Sound, Stage
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, mixes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.lab.fit.prediction_of_lines import risen_sum
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """A hypothesis on one body.

    Attributes
    ----------
    hypothesis : Hypothesis
        The hypothesis.
    body : StruckBody
        The body.
    base : ModalModel
        Undamped, uncorrected.
    model : ModalModel
        Damped, with all that acts on modes.
    order : (m,)
        The mode of `base` that each of `model` was.
    """

    hypothesis: Hypothesis
    body: StruckBody
    base: ModalModel
    model: ModalModel
    order: Array

    def effects_of_stage(self, stage: Stage) -> tuple[Effect, ...]:
        """Return the effects of a stage that act on this body."""
        return self.hypothesis.at(stage, fitted=self.body.recorded is not None)

    def without_corrections(self) -> Prediction:
        """Predict with the mesh's own frequencies; itself where the body has no corrections."""
        h = self.hypothesis
        known = self.body.name in (h.correction or {})
        return predict(replace(h, correction=None), self.body) if known else self

    def strikes_of(self, one: ObjectEvidence) -> list[int]:
        """Return the indices of the body's strikes that the evidence is of."""
        fitted = self.body.fitted
        return [fitted[i] for i in one.strike]

    def pattern(self) -> Array:
        """Compute J ψ (s, m) of its modes; see the function."""
        return pattern(self.body, self.model)

    def start(self, strikes: list[int]) -> Array:
        """Compute complex factors (s, m) of the amplitudes of some strikes: the phases at the onset."""
        own = self.body.own_phase
        if own is None:
            return np.tile(start(self.body.kind, self.model), (len(strikes), 1))
        return np.asarray(own[strikes][:, self.order])

    def impact(self, strike: int) -> Impact:
        """Return a strike with the effects on its force."""
        return impact_of(float(self.body.level_n_s[strike]), self.effects_of_stage(Stage.FORCE))

    def ring(self, strike: int) -> Ring:
        """Compute the modes as a strike excites them, before its pulse's spectrum; silent outside the band."""
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
        for effect in self.effects_of_stage(Stage.BANK):
            ring = effect.apply(ring)
        return ring

    def sound(self, strike: int, n: int, sr: int) -> Array:
        """Synthesize a strike (n,) from the onset on, in units of the file.

        Parameters
        ----------
        strike : int
            Index of the strike.
        n : int
            Length in samples.
        sr : int
            Sampling rate in Hz.
        """
        impact = self.impact(strike)
        ring, rise_s = self.ring(strike), 0.0 if self.body.rise_s is None else float(self.body.rise_s[strike])
        sample = (
            synthesize_risen(ring, impact, n, sr, round(rise_s * sr))
            if rise_s
            else synthesize_ring(ring, impact, n, sr)
        )
        index = -1
        if self.body.recorded is not None:
            index = self.body.fitted.index(strike) if strike in self.body.fitted else -1
        sound = Sound(sample, sr, impact.impulse_n_s, index)
        for effect in self.effects_of_stage(Stage.SOUND):
            sound = effect.apply(sound)
        return sound.sample

    def sounds(self, strikes: Iterable[int], n: int, sr: int) -> Array:
        """Synthesize several strikes (s, n)."""
        return np.stack([self.sound(strike, n, sr) for strike in strikes])


Predictions = Mapping[StruckBody, Prediction]  # one hypothesis on several bodies


def predict_each(h: Hypothesis, bodies: Iterable[StruckBody]) -> Predictions:
    """Predict every body, once each."""
    return {body: predict(h, body) for body in dict.fromkeys(bodies)}


def predict_fitted(h: Hypothesis, bodies: Iterable[StruckBody]) -> Predictions:
    """Predict the bodies that were fitted."""
    return predict_each(h, (body for body in bodies if body.recorded is not None))


def predict(h: Hypothesis, body: StruckBody) -> Prediction:
    """Predict a body.

    Corrections come before the effects; where these mix modes, after them, as they were learnt on the result.
    """
    base, fitted = undamped_model(h, body), body.recorded is not None
    none = np.zeros(base.mode_count)
    correction = (h.correction or {}).get(body.name, none)
    if len(correction) != len(none):  # learnt under another material
        correction = none
    last = mixes(h)
    lam = (2 * np.pi * base.freq_hz * (1 + (none if last else correction)) * np.exp(h.stretch)) ** 2
    decay = (h.alpha_per_s + h.beta_s * lam) / 2 if body.own_decay_per_s is None else body.own_decay_per_s
    model, order = order_modes(base, np.sqrt(np.maximum(lam - decay**2, 0)) / (2 * np.pi), decay)
    effects = h.at(Stage.MODES, fitted=fitted)
    for effect in (
        e for e in effects if e.owner is Owner.MATERIAL
    ):  # a law of the material is no fixture's, nor the air's
        model = effect.apply(model)
    model, order = _in_air(h, body, model, order)
    for effect in (e for e in effects if e.owner is not Owner.MATERIAL):
        before, model = model, effect.apply(model)
        if effect.traits.mixing is Mixing.NEIGHBOURS:
            order = order[came_from(before, model)]
    for effect in h.at(Stage.BANK, fitted=fitted):
        if isinstance(effect, RotatesPairs):  # axes of degenerate pairs
            model = effect.turn_pairs(model)
    if last:
        model, order = order_modes(model, model.freq_hz * (1 + correction[: model.mode_count]), model.decay_per_s)
    return Prediction(h, body, base, model, order)


def _in_air(h: Hypothesis, body: StruckBody, model: ModalModel, order: Array) -> tuple[ModalModel, Array]:
    """Add what the modes of a model lose to the air; order (m,): which of the body's each was.

    Modes of another elasticity are as many, and radiate as those that they have come from.
    """
    if not h.air or body.radiated_per_s is None or body.own_decay_per_s is not None:
        return model, order
    known = body.radiated_per_s[np.minimum(order, len(body.radiated_per_s) - 1)]
    omega = np.sqrt(model.omega0_squared_per_s2)
    decay = model.decay_per_s + h.air * known
    made, moved = order_modes(model, np.sqrt(np.maximum(omega**2 - decay**2, 0)) / (2 * np.pi), decay)
    return made, order[moved]


def synthesize_risen(ring: Ring, impact: Impact, n: int, sr: int, rise: int) -> Array:
    """Synthesize lines (n,) whose first peak is ``rise`` samples after the onset, as `risen_sum` does.

    A later hit begins at its own peak.
    """
    rise = min(rise, n)
    at_peak = ring.amplitude * np.exp(-ring.decay_per_s * rise / sr)
    heard = at_peak * impact.spectrum(ring.freq_hz) * impact.share[0] * (ring.freq_hz < 0.5 * sr)
    driven = risen_sum(ring.freq_hz, ring.decay_per_s, heard, rise, sr, rise)
    turned = replace(ring, amplitude=at_peak * np.exp(2j * np.pi * ring.freq_hz * rise / sr))
    return np.concatenate([driven, synthesize_ring(turned, impact, n - rise, sr)])


def impact_of(impulse_n_s: float, effects: Iterable[Effect]) -> Impact:
    """Apply the effects on a strike's force."""
    impact = Impact(impulse_n_s, np.zeros(1), np.ones(1))
    for effect in effects:
        impact = effect.apply(impact)
    return impact


def undamped_model(h: Hypothesis, body: StruckBody) -> ModalModel:
    """Return the body's model under the effects on its material, uncorrected."""
    effects = h.at(Stage.MATERIAL, fitted=body.recorded is not None)
    if not effects or body.elastic is None:
        return body.model if h.poisson is None or body.other is None else body.other(h.poisson)
    material = body.elastic.material
    for effect in effects:
        material = effect.apply(material)
    return body.elastic.solve(material.stiffness_pa / material.density_kg_m3)


def order_modes(model: ModalModel, freq_hz: Array, decay_per_s: Array) -> tuple[ModalModel, Array]:
    """Return a model with other modes, ascending, and the old index (m,) of each; overdamped ones are removed."""
    good = np.flatnonzero((freq_hz > 0) & np.isfinite(freq_hz))
    order = good[np.argsort(freq_hz[good], kind="stable")]
    kept = model.shape
    if len(order) < len(freq_hz) or (np.diff(order) < 0).any():
        kept = kept[:, :, order]
    return replace(model, freq_hz=freq_hz[order], decay_per_s=np.maximum(decay_per_s[order], 0.0), shape=kept), order


def came_from(old: ModalModel, new: ModalModel) -> Array:
    """Match each new mode (m,) to the old one that it is most like, by their motion on the surface, one to one."""
    sampled = 300  # vertices by which modes are compared
    step = max(1, len(old.shape) // sampled)
    a, b = (x.shape[::step].reshape(-1, x.mode_count).astype(float) for x in (old, new))
    return match_all(np.abs(b.T @ a) / np.linalg.norm(a, axis=0))


def pattern(body: StruckBody, model: ModalModel) -> Array:
    """Compute J ψ (s, m), real, of the body's strikes at the sensor; J is about 1 where it is not known."""
    at = model.shape[body.surface_count(model) :].astype(float)
    row = np.einsum("sxm,sx->sm", at, body.direction)
    return np.asarray(body.level_n_s[:, None] * row[:-1] * row[-1])


def in_band(body: StruckBody, model: ModalModel) -> Array:
    """Return 1 for modes (m,) in the band of the recordings, else 0."""
    return np.asarray((model.freq_hz >= body.band_hz[0]) & (model.freq_hz <= body.band_hz[1]), float)


def start(kind: str, model: ModalModel) -> Array:
    """Compute the complex factor (m,) of the amplitude: the phase at the onset; see estimator.observe."""
    if kind == "velocity":
        return np.asarray(1 + 1j * model.decay_per_s / (2 * np.pi * model.freq_hz))
    return np.full(model.mode_count, -1j if kind in ("sum", "lines") else 1.0 + 0j)
