"""Evidence from which effects are proposed: fitted lines with the hypothesis' modes, recordings with its synthesis.

    Struck + Lines + Hypothesis -> which modes each line represents -> ObjectEvidence (effects.protocol), one per fitted
        object -> Evidence

Strikes can be left out (their amplitudes and sounds), and lines: an effect must hold for those it was not fitted to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates, RingsAlong, Sound, Stage
from sonic_bullet.lab.diagnosis.evidence.amplitude_dependence import fallen
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, moves
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, in_band, predict, predict_fitted
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.common.line_assignment import assign_lines, cosines
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.lab.effects.searches import dereverberate
from sonic_bullet.lab.fit.pairing import degenerate_runs
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.lines.joint_lines import Lines, noise_rms
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor, floor_between


def evidence_of(
    h: Hypothesis, bodies: tuple[StruckBody, ...], band_hz: tuple[float, float], *, seed: int = 0
) -> Evidence:
    """Collect all fitted objects' evidence under a hypothesis.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    bodies : tuple of StruckBody
        The objects.
    band_hz : (2,)
        Band of the analysis.
    seed : int
        Of anything random in effects.
    """
    observed = tuple(object_evidence(p) for p in predict_fitted(h, bodies).values())
    return Evidence(observed, h.alpha_per_s, h.beta_s, h.gain, tuple(e.id for e in h.effects), band_hz, seed)


def object_evidence(
    p: Prediction, *, sounds: bool = True, anew: bool = False, plain: Prediction | None = None
) -> ObjectEvidence:
    """Collect one fitted object's evidence.

    Parameters
    ----------
    p : Prediction
        The hypothesis on the object.
    sounds : bool
        Whether to synthesize its strikes, which takes longest.
    anew : bool
        Pair lines as with effects that move modes.
    plain : Prediction
        p.without_corrections(), where it is known already.
    """
    h, body, model, recorded = p.hypothesis, p.body, p.model, p.body.recorded
    assert recorded is not None
    lines = recorded.lines
    line, mode = pair_lines_with_modes(p, anew=anew)
    mine = body.fitted[: len(lines.amplitude)]
    rows = p.pattern()[mine]
    push = rows * p.start(mine) * in_band(body, model)
    direct = path_response(h, model.freq_hz, recorded.sr) if recorded.signals is not None else np.ones(model.mode_count)
    pressed = np.stack([p.impact(i).spectrum(model.freq_hz) for i in mine])
    spectrum = pressed * direct
    expected = (
        np.stack([(h.gain * push * spectrum)[:, m].sum(axis=1) for m in mode], axis=1)
        if mode
        else np.zeros((len(mine), 0), complex)
    )
    participation = np.stack([rows[:, m].sum(axis=1) for m in mode], axis=1) if mode else np.zeros((len(mine), 0))
    plain = plain or p.without_corrections()
    own_hz = dict(zip(plain.order.tolist(), plain.model.freq_hz, strict=True))
    model_hz = np.array([np.mean([own_hz.get(int(p.order[k]), model.freq_hz[k]) for k in m]) for m in mode])
    gone = find_resonator_lines(h, lines) & sounds  # else they are in the recordings, and neighbours
    # beside lines that stand for modes there is only the attack
    rest = np.setdiff1d(np.flatnonzero(~gone), line) if body.family is not None else np.zeros(0, int)
    predicted = own = None
    if sounds and recorded.signals is not None:
        predicted, own = _synthesize_strikes(p, mine, recorded.signals)
    count = body.surface_count(model)
    observed = ObjectEvidence(
        impulse_n_s=body.level_n_s[mine],
        freq_hz=lines.freq_hz[line],
        decay_per_s=lines.decay_per_s[line],
        freq_sd_hz=lines.freq_sd_hz[line],
        decay_sd_per_s=lines.identified_sd_per_s[line],
        amplitude=lines.amplitude[:, line],
        amplitude_sd=lines.amplitude_sd[:, line],
        mode=mode,
        model_hz=model_hz,
        expected_decay_per_s=np.array([model.decay_per_s[m].mean() for m in mode]),
        expected=expected,
        pattern=participation,
        foreign_hz=lines.freq_hz[rest],
        foreign_decay_per_s=lines.decay_per_s[rest],
        foreign_amplitude=lines.amplitude[:, rest],
        foreign_sd=lines.amplitude_sd[:, rest],
        model=model if body.family is not None else None,
        strike_vertex=count + np.array(mine, int),
        strike_direction=body.direction[mine],
        sensor_vertex=len(model.vertex_m) - 1,
        sensor_direction=body.direction[-1],
        signal=recorded.signals,
        predicted=predicted,
        own=own,
        noise=lines.noise if recorded.signals is None else noise_of(recorded)[0],
        floor=None if recorded.signals is None else noise_of(recorded)[1],
        sr=recorded.sr,
        signed=lines.signed,
        push=h.gain * push * spectrum,
        pressed=np.abs(pressed),
        all_hz=model.freq_hz,
        plain=plain.model if body.family is not None else None,
        strike=tuple(range(len(mine))),
        source=recorded,
        elastic=body.elastic,
        poisson=None if moves(h) or plain.model.mode_count != body.model.mode_count else body.poisson,
    )
    return fallen(p, outside(h, observed))


@WhileAlive
def noise_of(recorded: Recorded) -> tuple[Array, Floor]:
    """Measure the noise of an object's recordings: its rms (s,) as if it were white, and its density."""
    assert recorded.signals is not None
    floor = floor_between(list(recorded.signals)) if recorded.floor is None else recorded.floor
    return noise_rms(recorded.signals, recorded.sr), floor


def _synthesize_strikes(p: Prediction, strikes: list[int], signals: Array) -> tuple[Array, Array | None]:
    """Synthesize strikes (s, n), and subtract other resonators from the recordings, where there are such."""
    assert p.body.recorded is not None
    n, sr, h = signals.shape[1], p.body.recorded.sr, p.hypothesis
    all_of_it, rest = p.sounds(strikes, n, sr), tuple(e for e in h.effects if not isinstance(e, RingsAlong))
    if len(rest) == len(h.effects):
        return all_of_it, None
    return all_of_it, signals - (all_of_it - predict(replace(h, effects=rest), p.body).sounds(strikes, n, sr))


def find_resonator_lines(h: Hypothesis, lines: Lines) -> Array:
    """Find the lines (l,), one of each mode, nearest to known lines of other resonators: no effect sees these."""
    voices = [np.array(e.lines(), float) for e in h.effects if isinstance(e, RingsAlong)]
    freq, decay = np.concatenate(voices, axis=1) if voices else np.zeros((2, 0))
    off, own = np.abs(lines.freq_hz[:, None] - freq), np.maximum(np.nan_to_num(lines.decay_per_s), 0.0)[:, None]
    # of a frequency, beside its width; times its decay: a line so near a known residual voice is that voice's
    own_width, alike_decays = 1e-4, 2.0
    alike = (off < decay / (2 * np.pi) + own_width * freq) & (
        np.maximum(own, decay) <= alike_decays * np.minimum(own, decay)
    )
    off = np.where(alike, off, np.inf)
    return np.asarray((alike & (off == off.min(axis=0, initial=np.inf))).any(axis=1))


def outside(h: Hypothesis, observed: ObjectEvidence, *, foreign: bool = True) -> ObjectEvidence:
    """Remove the room that the hypothesis has found from the lines of the evidence; foreign: of no mode, too."""
    for effect in h.effects:
        if isinstance(effect, Dereverberates):
            observed = dereverberate(effect, observed, foreign=foreign)
    return observed


def pair_lines_with_modes(p: Prediction, *, anew: bool = False) -> tuple[Array, tuple[Array, ...]]:
    """Pair lines (p,) and predicted modes.

    As they were fitted, where no effect has moved the modes; else, or anew, by frequency and pattern.
    """
    place = {int(k): i for i, k in enumerate(p.order)}
    body = p.body
    if not (anew or moves(p.hypothesis)):
        line = np.unique(body.line[body.line >= 0])
        mode = tuple(
            np.array(sorted(place[int(k)] for k in np.flatnonzero(body.line == one) if int(k) in place), int)
            for one in line
        )
        good = [i for i, m in enumerate(mode) if len(m)]
        return line[good], tuple(mode[i] for i in good)
    assert body.recorded is not None
    return _nearest(p, find_resonator_lines(p.hypothesis, body.recorded.lines))


def _nearest(p: Prediction, known: Array) -> tuple[Array, tuple[Array, ...]]:
    """Pair lines and modes by frequency, pattern and decay."""
    width, decade = 0.003, 1.0  # of ln f and ln d of a line over its mode where effects have moved it
    unlike, together = 0.5, 0.25  # price of patterns that have nothing in common; ln d of modes that sound as one line
    assert p.body.recorded is not None
    model, lines = p.model, p.body.recorded.lines
    if not len(lines.freq_hz):
        return np.zeros(0, int), ()
    mine = p.body.fitted[: len(lines.amplitude)]
    expected, observed = np.abs(p.pattern()[mine]), np.abs(lines.amplitude)
    with np.errstate(divide="ignore", invalid="ignore"):
        log_decay = np.log(lines.decay_per_s), np.log(model.decay_per_s)
    pairs = assign_lines(
        np.log(lines.freq_hz),
        np.log(model.freq_hz),
        width,
        log_decay=log_decay,
        decay_width=decade,
        likeness=np.nan_to_num(cosines(observed, expected)),
        pattern_price=unlike,
        weight=np.where(known, 0.0, 1.0)[:, None],
    )
    # degenerate modes that nothing has set apart are one line
    group = degenerate_runs(model.freq_hz)
    taken, mode = set(pairs.mode.tolist()), []
    for c in pairs.mode:
        like = np.abs(np.log(np.maximum(model.decay_per_s, 1e-9) / max(float(model.decay_per_s[c]), 1e-9))) < together
        others = [int(k) for k in np.flatnonzero((group == group[c]) & like) if k == c or int(k) not in taken]
        taken |= set(others)
        mode.append(np.array(others))
    return pairs.line, tuple(mode)


def path_response(h: Hypothesis, freq_hz: Array, sr: int) -> Array:
    """Compute the complex response (f,) of the sound path's first milliseconds.

    Its effects are applied to a weak impulse, less what they add to silence.
    """
    direct_s = 0.008  # of the sound path: what comes later is an echo
    # lines are dereverberated already
    effects = [e for e in h.at(Stage.SOUND) if not isinstance(e, Dereverberates)]
    if not effects:
        return np.ones(len(freq_hz), complex)
    n = round(direct_s * sr)
    weak, silent = Sound(1e-6 * np.eye(1, n)[0], sr, 1.0), Sound(np.zeros(n), sr, 1.0)
    for effect in effects:
        weak, silent = effect.apply(weak), effect.apply(silent)
    tap = (weak.sample - silent.sample) / 1e-6
    return np.asarray(np.exp(-2j * np.pi * np.outer(freq_hz, np.arange(n)) / sr) @ tap)


def thin_evidence(evidence: Evidence, at: tuple[Recorded, int], keep: float, rng: np.random.Generator) -> Evidence:
    """Remove one strike and a random part of all lines from evidence; an object with no other recording goes, too.

    Parameters
    ----------
    evidence : Evidence
        The whole.
    at : (RecordedObject, int)
        The strike: whose, and which of those.
    keep : float
        Fraction of the lines that stay.
    rng : Generator
        Selects them.
    """
    source, strike = at
    rest = [h for h in evidence.observed if h.source is not source or len(h.impulse_n_s) > 1]
    return replace(evidence, observed=tuple(_thin(h, strike if h.source is source else None, keep, rng) for h in rest))


def _thin(h: ObjectEvidence, strike: int | None, keep: float, rng: np.random.Generator) -> ObjectEvidence:
    """Remove one strike and a random part of the lines from one object's evidence."""
    s = np.array([i for i in range(len(h.impulse_n_s)) if i != strike], int)
    k = (
        np.sort(rng.permutation(len(h.freq_hz))[: max(3, round(keep * len(h.freq_hz)))])
        if keep < 1
        else np.arange(len(h.freq_hz))
    )
    k = k[k < len(h.freq_hz)]
    return replace(
        h,
        impulse_n_s=h.impulse_n_s[s],
        freq_hz=h.freq_hz[k],
        decay_per_s=h.decay_per_s[k],
        freq_sd_hz=h.freq_sd_hz[k],
        decay_sd_per_s=h.decay_sd_per_s[k],
        amplitude=h.amplitude[s][:, k],
        amplitude_sd=h.amplitude_sd[s][:, k],
        mode=tuple(h.mode[i] for i in k),
        model_hz=h.model_hz[k],
        expected_decay_per_s=h.expected_decay_per_s[k],
        expected=h.expected[s][:, k],
        pattern=h.pattern[s][:, k],
        foreign_amplitude=h.foreign_amplitude[s],
        foreign_sd=h.foreign_sd[s],
        strike_vertex=h.strike_vertex[s],
        strike_direction=h.strike_direction[s],
        signal=h.signal[s] if h.signal is not None else None,
        predicted=h.predicted[s] if h.predicted is not None else None,
        own=h.own[s] if h.own is not None else None,
        push=h.push[s],
        pressed=h.pressed[s],
        noise=h.noise[s] if len(h.noise) == len(h.impulse_n_s) else h.noise,
        strike=tuple(h.strike[i] for i in s),
    )
