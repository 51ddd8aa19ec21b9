"""The paper's procedure and this project's fit on recorded cases, each held against the case's truth.

    paper          first 'fit' strike -> greedy features -> starts × simplex down Π -> α, β, γ, σ
    paper's Π      first 'fit' strike -> `extract` -> the fast search down the same Π -> α, β, γ, σ
    this project   all 'fit' strikes  -> `fit_case` -> α, β, γ, ν, σ

The paper knows one recording and a body of the guessed Poisson's ratio. A truth holds α, β, and the frequencies and
decays of the first object's modes; it holds no E/ρ, so that γ is judged by the frequencies that it makes: the n-th mode
of the model against the n-th of the truth. Times are of one processor, model and kernels being there.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.cases import Case, read_case
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.fit.pairing import group_modes
from sonic_bullet.lab.fit.recorded import RecordedObject, gather
from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, SonicBulletError
from studies.ren2013.greedy import greedy
from studies.ren2013.optimise import fast, reference
from studies.ren2013.problem import Found, Problem
from studies.ren2013.published import MATERIALS, tables

PAPER, FAST, FIT = "paper: greedy, starts, simplex", "paper's Π, fast search", "this project, `fit`"
PAPERS = {"steel": "metal", "aluminium": "metal", "brass": "metal"}
"""The paper's material that a case's is nearest to; others keep their names."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What one procedure says of a case's first object. ν as assumed or found; seconds of one processor.

    features: damped sinusoids or lines it rests on. starts, evaluations: of Π, 0 where none is walked down; search_s:
    of the seconds, those that the search took.
    """

    procedure: str
    alpha_per_s: float
    beta_s: float
    gamma_m2_s2: float
    poisson: float
    features: int
    starts: int
    evaluations: int
    seconds: float
    search_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """A case with one struck object, its first known strike, and its truth (empty where there is none)."""

    case: Case
    thing: RecordedObject
    strike: int
    truth: dict[str, Any]

    @property
    def signal(self) -> Array:
        """(n,) the strike's recording from its onset."""
        assert self.thing.signals is not None
        return np.asarray(self.thing.signals[self.strike])

    def problem(self, features: Features) -> Problem:
        """The paper's question: these features, this recording, this body at γ = 1 and the guessed ν."""
        assert self.thing.family is not None and self.thing.seen is not None
        group = group_modes(self.thing.family, self.thing.seen, 0.0, self.thing.guess.poisson)
        return Problem(features, self.signal, (2 * np.pi * group.freq_hz) ** 2, group.pattern[self.strike])

    def in_band(self) -> int:
        """Modes of the guessed body in the case's band: how many features the greedy search is asked for."""
        assert self.thing.family is not None
        guess = self.thing.guess
        value, _ = self.thing.family.modes(guess.youngs_pa / guess.density_kg_m3, guess.poisson)
        return int((np.sqrt(value) / (2 * np.pi) < self.case.band_hz[1]).sum())


def recorded(folder: Path) -> Recorded:
    """A case that the paper's procedure can be asked about. Raises SonicBulletError, its reason that it cannot."""
    case = read_case(folder)
    struck = {r.object for r in case.recordings if r.split == "fit"}
    if len(struck) != 1:
        raise FileError(f"{len(struck)} objects are struck", "the paper's procedure knows one")
    (thing,) = gather(case)[:1]
    if thing.family is None or thing.seen is None or thing.signals is None or not thing.seen.known.any():
        raise FileError(
            "it has no mesh, no audio, or no strike of known place", "the paper's procedure needs all three"
        )
    truth = folder / "truth.json"  # of the case's first object
    known = truth.is_file() and thing.thing.name == next(iter(case.objects), "")
    said = json.loads(truth.read_text()) if known else {}
    return Recorded(case, thing, int(np.flatnonzero(thing.seen.known)[0]), said)


def greedy_features(x: Recorded) -> Features:
    """The strike's features as the paper extracts them; it gives no spreads."""
    freq_hz, decay, amplitude = greedy(x.signal, x.thing.sr, x.in_band()).T
    none = np.full(len(freq_hz), np.nan)
    noise_dbfs = float(20 * np.log10(max(float(x.thing.lines.noise[x.strike]), 1e-15)))
    return Features(freq_hz, decay, amplitude, np.zeros(len(freq_hz)), none, none, none, 0.0, noise_dbfs, x.thing.sr)


def searched(
    x: Recorded, procedure: str, features: Callable[[Recorded], Features], search: Callable[[Problem], Found]
) -> Estimate:
    """α, β, γ by a search down Π."""
    begun = time.process_time()
    seen = features(x)
    between = time.process_time()
    found = search(x.problem(seen))
    end = time.process_time()
    said = (found.alpha_per_s, found.beta_s, found.gamma_m2_s2, x.thing.guess.poisson)
    counts = (len(seen.freq_hz), found.starts, found.evaluations)
    return Estimate(procedure, *said, *counts, end - begun, end - between)


def by_paper(x: Recorded) -> Estimate:
    """The paper's procedure. Raises SonicBulletError."""
    return searched(x, PAPER, greedy_features, reference)


def by_fast_search(x: Recorded) -> Estimate:
    """The paper's metric, with this project's features and the fast search. Raises SonicBulletError."""

    def features(y: Recorded) -> Features:
        return extract(y.signal, y.thing.sr, onset_s=0.0, band_hz=y.case.band_hz)

    return searched(x, FAST, features, fast)


def fitted(x: Recorded) -> Estimate:
    """This project's fit of all 'fit' strikes. Raises SonicBulletError."""
    begun = time.process_time()
    fit = fit_case(x.case)
    spent = time.process_time() - begun
    said = (fit.fit.alpha_per_s, fit.fit.beta_s, fit.fit.gamma_m2_s2, fit.fit.poisson_ratio)
    return Estimate(FIT, *said, len(fit.objects[0].evidence.lines.freq_hz), 0, 0, spent)


PROCEDURES = {PAPER: by_paper, FAST: by_fast_search, FIT: fitted}


def errors(x: Recorded, e: Estimate) -> tuple[float, float, float, float]:
    """Relative errors of α and β, and the median ones of the modes' frequencies and decays; NaN without a truth."""
    freq_true, decay_true = (np.array(x.truth.get(name, [])) for name in ("modes_hz", "decay_per_s"))
    assert x.thing.family is not None
    value, _ = x.thing.family.modes(e.gamma_m2_s2, e.poisson)
    m = min(len(value), len(freq_true))
    if not m or "alpha" not in x.truth:
        return np.nan, np.nan, np.nan, np.nan
    decay = (e.alpha_per_s + e.beta_s * value[:m]) / 2
    freq = np.sqrt(np.maximum(value[:m] - decay**2, 0)) / (2 * np.pi)
    return (
        e.alpha_per_s / x.truth["alpha"] - 1,
        e.beta_s / x.truth["beta"] - 1,
        float(np.median(np.abs(freq / freq_true[:m] - 1))),
        float(np.median(np.abs(decay / decay_true[:m] - 1))),
    )


def lacks(x: Recorded) -> str:
    """What the truth says that the plain model lacks."""
    named = ", ".join(sorted(effect["id"] for effect in x.truth.get("effects", ()))) or "nothing"
    return named if x.truth else "no truth"


def row(x: Recorded, e: Estimate) -> str:
    """One line of the table on accuracy."""
    alpha, beta, freq, decay = (f"{100 * off:.3g} %" if np.isfinite(off) else "no truth" for off in errors(x, e))
    cells = (
        f"{x.case.name} | {lacks(x)} | {e.procedure} | {e.features}",
        f"{e.gamma_m2_s2:.4e} | {e.alpha_per_s:.4g} | {e.beta_s:.4g} | {alpha} | {beta} | {freq} | {decay}",
        f"{e.seconds:.1f}",
    )
    return f"| {' | '.join(cells)} |"


def cost(x: Recorded, e: Estimate) -> str:
    """One line of the table beside the paper's Table II."""
    name = PAPERS.get(x.thing.guess.name, x.thing.guess.name)
    theirs = MATERIALS.get(name)
    said = f"{theirs.starts} | {theirs.iterations} | {theirs.seconds_a_start:g}" if theirs else "none | none | none"
    ours = f"{e.starts} | {e.evaluations / e.starts:.0f} | {e.search_s / e.starts:.2f}"
    return f"| {x.case.name} | {x.thing.guess.name} | {ours} | {name if theirs else 'none'} | {said} |"


def main(data: Path, names: list[str]) -> int:
    """All cases of a folder, or those named; 1 where something could not be estimated, 2 where there is no case."""
    folders = sorted(p.parent for p in data.glob("*/case.json") if not names or p.parent.name in names)
    if not folders:
        print(f"{data}: no cases; give the folder that holds them", file=sys.stderr)
        return 2
    heads = "case | lacks | procedure | features | γ = E/ρ m²/s² | α 1/s | β s | α off | β off | f off | d off | s"
    print(f"| {heads} |\n{'|---' * 12}|")
    made, costs, missing = 0, [], []
    for folder in folders:
        try:
            x = recorded(folder)
        except SonicBulletError as error:
            missing += [f"{folder.name}, {name}: {error}" for name in PROCEDURES]
            continue
        for name, procedure in PROCEDURES.items():
            try:
                e = procedure(x)
            except SonicBulletError as error:
                missing.append(f"{folder.name}, {name}: {error}")
                print(f"| {folder.name} | {lacks(x)} | {name} {'| none ' * 8}| |", flush=True)
                continue
            made += 1
            print(row(x, e), flush=True)
            if name == PAPER:
                costs.append(cost(x, e))
    heads = "case | material | starts | Π a start | s a start | paper's material | starts | iterations | s a start"
    print("\n".join(["", f"| {heads} |", "|---" * 9 + "|", *costs, "", tables(), ""]))
    print(f"{made} estimates of {len(folders)} cases, {len(missing)} that could not be made", *missing, sep="\n")
    return 1 if missing else 0
