"""The paper's search and this project's fit on real bodies with a mesh, whose strikes nobody placed.

    takes of a set (of the bowl's microphones those that hear no second touch) -> case
    -> lines of the take (ringing 20 ms after the onset, by plain peaks of a spectrum)
    paper         greedy features of one take's first second -> starts × simplex down Π; strikes without a place: every
                  mode is struck alike
    this project  `fit` of all takes
    -> of the ten lines with most energy, how many a mode within 1 % explains, how many would by chance, their T60

By chance: a line of frequency f finds a mode within ± 1 % with probability 1 − e^{−0.02 f n(f)}, n the modes a hertz
within half an octave of it.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.fit.recorded import gather
from sonic_bullet.records import Array
from studies.lines_methods import by_peaks
from studies.ren2013.cases import Recorded, greedy_features
from studies.ren2013.optimise import reference
from studies.ren2013.problem import Problem

SETS = {
    "diffsound-bowl": ("bowl.obj", "mic[0246].flac", "porcelain", "no other source"),
    "pyrfda-steel-bar": ("mesh/bar.obj", "dev/*.flac", "steel", "ASTM E1876 from f₁: E/ρ 2.735e7"),
}
LINES, NEAR, SECONDS = 10, 0.01, 1.0
EARLY_S = 0.25  # of the spectrum that shows lines, most of which are gone after it
HEAD = "| body | procedure | E/ρ m²/s² | lines within 1 % | by chance | T60 off, median | s |"


def case_of(data: Path, name: str, folder: Path) -> Path:
    """Write a case of all takes of a set."""
    mesh, takes, material, _ = SETS[name]
    shutil.copy(data / name / mesh, folder / "body.obj")
    recordings = []
    for take in sorted((data / name).glob(takes)):
        shutil.copy(take, folder / take.name.replace(" ", "_"))
        recordings.append({"file": take.name.replace(" ", "_"), "object": "body"})
    case = {
        "format": "sonic-bullet-case/1",
        "case": name,
        "objects": {"body": {"mesh": "body.obj", "units": "m", "material": material}},
        "sensor": {"type": "microphone"},
        "recordings": recordings,
    }
    (folder / "case.json").write_text(json.dumps(case))
    return folder


def measured_lines(signals: Array, sr: int) -> Array:
    """Poles (k,) in 1/s of the lines with most energy of the takes (s, n), each counted once."""
    pole, energy = np.zeros(0, complex), np.zeros(0)
    for signal in signals:
        found, amplitude = by_peaks(signal, sr, EARLY_S)
        pole = np.concatenate([pole, found])
        energy = np.concatenate([energy, np.abs(amplitude) ** 2 / -found.real / (signal**2).sum()])
    kept: list[int] = []
    for k in np.argsort(-energy):
        if all(abs(pole[k].imag / pole[j].imag - 1) > NEAR / 2 for j in kept):
            kept.append(int(k))
    return pole[kept[:LINES]]


def row(body: str, procedure: str, gamma: float, modes: tuple[Array, Array], lines: Array, seconds: float) -> str:
    """One line of the table. modes: frequency in Hz and decay in 1/s (m,)."""
    freq, decay = modes
    line_hz = lines.imag / (2 * np.pi)
    near = np.abs(freq[:, None] / line_hz - 1).argmin(axis=0)
    hit = np.abs(freq[near] / line_hz - 1) < NEAR
    count = (np.abs(np.log2(freq[:, None] / line_hz)) < 0.25).sum(axis=0)
    chance = 1 - np.exp(-2 * NEAR * line_hz * count / (line_hz * (2**0.25 - 2**-0.25)))
    off = np.abs(np.log(decay[near[hit]] / -lines.real[hit]))
    told = f"{100 * np.expm1(np.median(off)):.0f} %" if len(off) else "none"
    return (
        f"| {body} | {procedure} | {gamma:.4g} | {int(hit.sum())} of {len(line_hz)} | {chance.sum():.1f} | {told} "
        f"| {seconds:.0f} |"
    )


def main(data: Path, names: tuple[str, ...]) -> int:
    """Write the table."""
    print(f"{HEAD}\n{'|---' * 7}|", flush=True)
    for name in names or tuple(SETS):
        with tempfile.TemporaryDirectory() as place:
            case = read_case(case_of(data, name, Path(place)))
            (thing,) = gather(case)
            assert thing.signals is not None and thing.family is not None
            lines = measured_lines(thing.signals, thing.sr)
            guess = thing.guess
            value, _ = thing.family.modes(guess.youngs_pa / guess.density_kg_m3, guess.poisson)
            hat = value / (guess.youngs_pa / guess.density_kg_m3)
            begun = time.process_time()
            one = Recorded(case, replace(thing, signals=thing.signals[:, : round(SECONDS * thing.sr)]), 0, {})
            problem = Problem(greedy_features(one), one.signal, hat, np.ones(len(hat)))
            found = reference(problem)
            spent = time.process_time() - begun
            lam = found.gamma_m2_s2 * hat
            decay = (found.alpha_per_s + found.beta_s * lam) / 2
            freq = np.sqrt(np.maximum(lam - decay**2, 1.0)) / (2 * np.pi)
            print(row(name, "paper", found.gamma_m2_s2, (freq, decay), lines, spent), flush=True)
            begun = time.process_time()
            fit = fit_case(case)
            spent = time.process_time() - begun
            (body,) = fit.objects
            modes = body.freq_hz, np.where(body.line >= 0, body.measured_decay_per_s, body.decay_per_s)
            print(row(name, "`fit`", fit.fit.gamma_m2_s2, modes, lines, spent), flush=True)
    for name in names or tuple(SETS):
        print(f"{name}: {SETS[name][3]}")
    return 0
