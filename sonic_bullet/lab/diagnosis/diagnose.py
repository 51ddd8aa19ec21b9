"""`diagnose`: a case in, a Diagnosis out.

    read the 'fit' strikes -> fit the baseline (baseline.py) -> select effects (stepwise.py) -> verdict, errors on all
        splits, predictions

The baseline must be nearer to the 'holdout' strikes than silence is, as in `fit`: else there is nothing to select from.
Apart from that nothing of 'holdout' and 'transfer' has any influence; they are compared at the very end.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.effects import EFFECTS
from sonic_bullet.effects.protocol import Effect
from sonic_bullet.files import read_audio, read_channel
from sonic_bullet.files.cases import SPLITS, Case, CaseRecording, read_case
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.lab.diagnosis.deciding_measurement import next_measurement
from sonic_bullet.lab.diagnosis.evidence.baseline import baseline
from sonic_bullet.lab.diagnosis.prediction.line_score import CAP, list_line_parts, off_by
from sonic_bullet.lab.diagnosis.prediction.loudness_distance import sone_distance
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions, predict_each
from sonic_bullet.lab.diagnosis.prediction.score import (
    AudioObservation,
    ComparableTakes,
    LeftOut,
    comparable,
    least_db,
    mean_db,
    take_of,
)
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.effect_table import effect_table
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd, select_effects
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained, indistinct_places, list_left_out
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.material_fit import choose_lines
from sonic_bullet.lab.fit.recorded import check_meshes, gather, onset_sample, recorded_signals
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import report_progress, show_progress
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Result of a diagnosis: what the model lacks.

    Attributes
    ----------
    case : Case
        What was diagnosed.
    found : CaseFit
        The fit.
    bodies : tuple of StruckBody
        The objects.
    takes : tuple of Take
        The fitted strikes that have audio.
    closed : Closed or NothingCompared
        The end of the selection.
    errors, errors_sone : dict
        {"before": {split: …}, "after": {split: …}, "floor": …} in dB, in sone; None where there is no audio, or none of
        it could be compared.
    errors_lines : dict
        Likewise for measured lines in place of audio, of ln f and ln d.
    unexplained : dict
        What is left, beside names too, in words and numbers; empty where nothing is.
    not_compared : dict
        By split, what could not be compared; empty where all could.
    warnings : tuple of str
        One line each, the fit's among them.
    unfitted : tuple of Take
        The strikes of the other splits that have audio.
    """

    case: Case
    found: CaseFit
    bodies: tuple[StruckBody, ...]
    takes: tuple[AudioObservation, ...]
    closed: SelectionEnd | NothingCompared
    errors: dict[str, Any]
    errors_sone: dict[str, Any]
    errors_lines: dict[str, Any]
    unexplained: dict[str, Any]
    not_compared: dict[str, tuple[LeftOut, ...]]
    warnings: tuple[str, ...]
    unfitted: tuple[AudioObservation, ...] = ()

    @property
    def verdict(self) -> str:
        """Return "explained", "none", "unexplained" or "worse-than-silence"."""
        return self.closed.verdict


@one_thread()
def diagnose(
    case: Case | str | os.PathLike[str],
    *,
    effects: Sequence[type[Effect]] = EFFECTS,
    seed: int = 0,
    cache: Place = "default",
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find what the fitted model lacks, from the case's 'fit' strikes.

    Parameters
    ----------
    case : Case or path
        The case.
    effects : sequence of types
        The candidates, your own with the package's: ``EFFECTS + (Mine,)``.
    seed : int
        Of the control effects and folds.
    cache : Place
        Where solved modes are kept.
    progress : callable
        Called with what is being done.

    Raises
    ------
    SonicBulletError
        A file, mesh or number makes a fit impossible.
    """
    if not isinstance(case, Case):
        case = read_case(case)
    with show_progress(progress):
        return _diagnose_case(case, effects, seed, cache)


def _diagnose_case(case: Case, effects: Sequence[type[Effect]], seed: int, cache: Place) -> Diagnosis:
    check_meshes(case, (r.object for r in case.recordings))
    recorded = choose_lines(case, gather(case, cache=cache, clipped=True))
    known = tuple(e for e in effects if case.medium == "unknown" or not e.traits.needs_unknown_medium)
    for by_lines in (False, True):
        start = baseline(case, recorded, by_lines=by_lines, cache=cache)
        found, bodies, takes = start.found, start.bodies, start.takes
        every = {"fit": takes} | {split: _others(case, bodies, takes, split) for split in SPLITS[1:]}
        end = select_effects(
            start.hypothesis,
            bodies,
            takes or list_line_parts(bodies),
            known,
            case.band_hz,
            seed=seed,
            against_silence=[t for t in every["holdout"] if t.body.recorded is not None],
        )
        if end.added or not start.doubtful:
            break  # else no effect makes the shape's modes meet the lines: these may be another body's
    report_progress("comparing with what was not fitted")
    errors: dict[str, Any] = {"before": {}, "after": {}, "floor": None}
    sone: dict[str, Any] = {"before": {}, "after": {}, "floor": None}
    out: dict[str, tuple[LeftOut, ...]] = {"fit": end.left_out} if end.left_out else {}
    made = _before_and_after(end, [take.body for mine in every.values() for take in mine])
    for split, mine in every.items():
        held = comparable(mine, made["before"])
        out |= {split: held.left_out} if held.left_out else {}
        for name, one in made.items():
            errors[name][split] = mean_db(held.takes, one) if isinstance(held, ComparableTakes) else None
            sone[name][split] = sone_distance(held.takes, one) if isinstance(held, ComparableTakes) else None
        if split == "fit" and isinstance(held, ComparableTakes):
            errors["floor"] = least_db(held.takes, made["after"])
    left, warnings = describe_unexplained(end, takes), (*found.warnings, *_warnings(end, out))
    lines, unfitted = _of_lines(case, bodies, end), tuple(t for split in SPLITS[1:] for t in every[split])
    return Diagnosis(case, found, bodies, takes, end, errors, sone, lines, left, out, warnings, unfitted)


def _before_and_after(end: SelectionEnd | NothingCompared, bodies: Sequence[StruckBody]) -> dict[str, Predictions]:
    """Predict the bodies by the hypotheses without effects and with them; once where these are one."""
    before = predict_each(end.before, bodies)
    return {"before": before, "after": before if end.after is end.before else predict_each(end.after, bodies)}


def _warnings(end: SelectionEnd | NothingCompared, out: dict[str, tuple[LeftOut, ...]]) -> list[str]:
    """List what a verdict does not rest on, and what obstructs it, a line each."""
    said = [f"{len(one)} of split '{split}' could not be compared: {list_left_out(one)}" for split, one in out.items()]
    if isinstance(end, NothingCompared):
        return said
    if all(t.body.family is None and all(r.position_m is None for r in t.body.recordings) for t in end.judged):
        said.append("no strike is placed: modes are the recorded lines, as loud as on average; give strike.position")
    if len(end.judged) == 1:
        said.append("one strike alone: nothing can be left out, so no effect can be named; record more strikes")
    if end.mesh_off:
        said.append(
            f"upper modes are up to {100 * end.mesh_off:.1f} % off, more than is corrected: what is left "
            "open is the mesh's; a finer one closes it"
        )
    return [*said, *indistinct_places(end)]


def _of_lines(case: Case, bodies: tuple[StruckBody, ...], end: SelectionEnd | NothingCompared) -> dict[str, Any]:
    """Compute rms of ln f and ln d of measured lines in place of audio, before and after, by split; empty without."""
    found: dict[str, Any] = {}
    lined = [body for body in bodies if any(r.lines for r in body.recordings)]
    made = _before_and_after(end, lined)
    for body in lined:
        for split in SPLITS:
            rows = [line for r in body.recordings if r.split == split and r.lines for line in r.lines]
            if not rows:
                continue
            freq = np.array([line.freq_hz for line in rows])
            decay = np.array([np.nan if line.decay_per_s is None else line.decay_per_s for line in rows])
            for name, one in made.items():
                off, lost = off_by(one[body], freq, decay)
                entry = {
                    "frequency_rms": float(np.sqrt((off**2).mean())),
                    "lines": len(rows),
                    "unpaired": int((off >= CAP).sum()),
                }
                entry |= {"decay_rms": float(np.sqrt(np.nanmean(lost**2)))} if np.isfinite(lost).any() else {}
                found.setdefault(name, {})[split] = entry
    return found


def _others(
    case: Case, bodies: tuple[StruckBody, ...], takes: tuple[AudioObservation, ...], split: str
) -> tuple[AudioObservation, ...]:
    """Read the strikes of another split whose audio is there."""
    found = []
    floors = [body.recorded.floor if body.recorded is not None else None for body in bodies]
    session = next((floor for floor in floors if floor is not None), None)
    for body, floor in zip(bodies, floors, strict=True) if takes else ():
        thing = body.recorded.thing if body.recorded is not None else case.objects[body.name]
        for i, r in enumerate(body.recordings):
            if r.split == split and r.file is not None and r.file.is_file():
                hum_hz = body.recorded.hum_hz if body.recorded is not None else 0.0
                (signal,), sr = recorded_signals(case, thing, (r,), hum_hz)
                found.append(take_of(body, i, signal, sr, session if floor is None else floor))
    return tuple(found)


def onset_of(case: Case, bodies: tuple[StruckBody, ...], sr: int) -> int:
    """Return the sample at which strikes arrive: as declared, or the median of the fitted ones."""
    if case.onset_s is not None:
        return round(case.onset_s * sr)
    files = [
        (r.file, r.channel)
        for body in bodies
        if body.recorded is not None and body.recorded.signals is not None
        for r in body.recorded.recordings
        if r.file
    ]
    late = [onset_sample(read_channel(file, channel)[0], sr) for file, channel in files]
    return int(np.median(late)) if late else 0


def length_of(recording: CaseRecording) -> tuple[int, int]:
    """Return samples and rate of a recording's file."""
    sample, sr = read_audio(recording.file or "")
    return sample.shape[1], sr


def predictions(d: Diagnosis) -> list[tuple[str, int, Array, Array]]:
    """Synthesize every strike that has a place, of every split, before and after the diagnosis.

    Returns
    -------
    list of (stem, sr, before, after)
        Sounds (n,) as long as the fitted recordings, in their units.
    """
    known = [r for b in d.bodies if b.recorded is not None for r in b.recorded.recordings if r.file is not None]
    if not known:
        return []
    n, sr = length_of(known[0])
    start = onset_of(d.case, d.bodies, sr)
    both, found = _before_and_after(d.closed, d.bodies).values(), []
    for body in d.bodies:
        for i, r in enumerate(body.recordings):
            if r.file is None or (body.family is not None and r.position_m is None):
                continue
            before, after = (np.concatenate([np.zeros(start), one[body].sound(i, n - start, sr)]) for one in both)
            found.append((Path(r.file).stem, sr, before, after))
    return found


def diagnosis_to_json(d: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis as JSON holds it."""
    parameters = {c.id: c.effect.parameters() for c in (*d.closed.tried, *d.closed.added)}
    return {
        "case": d.case.name,
        "verdict": d.verdict,
        "effects": [
            {
                "id": c.id,
                "parameters": c.effect.parameters(),
                "spread": c.spread,
                "error_drop_db": c.mean_db,
                "stage": c.effect.stage.value,
                "owner": c.effect.owner.value,
                "reference": c.effect.reference,
            }
            for c in d.closed.added
        ],
        "candidates": [
            {
                "id": row.id,
                "numbers": row.numbers,
                "cv_error_drop_db": row.nearer_db,
                "standard_error_db": row.standard_error_db,
                "null_drop_db": row.chance_db,
                "strikes": row.strikes,
                "word": row.word,
                "parameters": parameters[row.id],
            }
            for row in effect_table(d.closed)
        ],
        "errors": d.errors,
        "errors_sone": d.errors_sone,
        **({"errors_lines": d.errors_lines} if d.errors_lines else {}),
        "unexplained": d.unexplained,
        "next_measurement": next_measurement(d.found, d.closed, d.unexplained),
        "not_compared": [
            {"split": split, "name": one.name, "why": one.why} for split, left in d.not_compared.items() for one in left
        ],
        "baseline": {
            "alpha_per_s": d.closed.before.alpha_per_s,
            "beta_s": d.closed.before.beta_s,
            "gamma_m2_s2": d.found.fit.gamma_m2_s2 if d.found.has_material else None,
            "poisson_ratio": d.found.fit.poisson_ratio if d.found.has_material else None,
            "gain": d.closed.before.gain,
            "radiation_factor": d.closed.before.air or None,
            "correction_rms": {
                b.name: float(np.sqrt((b.correction**2).mean())) if len(b.correction) else 0.0
                for b in d.bodies
                if b.recorded is not None
            },
        },
        "after": {
            "alpha_per_s": d.closed.after.alpha_per_s,
            "beta_s": d.closed.after.beta_s,
            "gain": d.closed.after.gain,
            "radiation_factor": d.closed.after.air or None,
        },
        "warnings": [*d.case.warnings, *d.warnings],
    }
