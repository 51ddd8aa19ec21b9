"""What a fit hands on: one object under the fitted material, and the case with all its objects.

material_fit.py makes them, fit_verdict.py judges, prediction_of_lines.py, fitted_preset.py and
apps/report/plots/fit_plot.py use them; none of those knows another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sonic_bullet.files.cases import Case
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.lines.line_values import MaterialFit
from sonic_bullet.records import Array

POISSON_GUESS_SD = 0.04
POISSON_IDENTIFIED_SD = 0.03  # a spread of ν above this says nothing that the guess did not

RadiationIn = Literal["nothing", "apart", "damping"]
"""Where a fit has what the air takes: nowhere, as nothing is lost to a medium; apart from the material's α and β; or in
them, where the two cannot be separated.
"""
NO_GAIN = "no gain makes it nearer than silence"


@dataclass(frozen=True, slots=True, eq=False)
class ObjectFit:
    """One object under the fitted material.

    m groups of modes in the band, ascending: freq_hz with, model_hz without their correction (m,); decay_per_s (m,).
    pattern (s, m): J ψ; line (m,): the line that each is, or -1; measured_hz, measured_decay_per_s (m,) NaN where none.
    sensor_weight (m,): of a microphone, else 1.
    """

    evidence: RecordedObject
    freq_hz: Array
    model_hz: Array
    decay_per_s: Array
    pattern: Array
    line: Array
    measured_hz: Array
    measured_decay_per_s: Array
    sensor_weight: Array
    member: tuple[Array, ...]

    @property
    def correction(self) -> Array:
        """freq_hz/model_hz - 1 (m,): what the mesh's error was taken to be."""
        return np.asarray(self.freq_hz / self.model_hz - 1)


@dataclass(frozen=True, slots=True)
class TakeDistance:
    """One take's log-spectral distances in dB: of the fit's prediction, of silence, of the nearest other take.

    NaN where nothing of it stands above its noise, or where there is no other take.
    free_gain: whether the prediction's gain was fitted to this take, its impulse or place being unknown. gain: that
    gain, 0 where none makes it nearer than silence; else 1. plausible_db: of the guessed material on the object's
    shape, at its best gain; NaN where it has no mesh. levels_db, other_take_levels_db: distances of levels by band and
    time (signal/band_time.py): of what is predicted with the noise that fitted takes share beside it, and of the
    nearest of them; NaN where no residual is asked for.
    """

    file: str
    split: str
    predicted_db: float
    silence_db: float
    other_take_db: float
    free_gain: bool
    gain: float = 1.0
    plausible_db: float = float("nan")
    levels_db: float = float("nan")
    other_take_levels_db: float = float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class CaseFit:
    """A fit and what it rests on.

    youngs_pa = γρ with ρ of the guess. damping_scatter: relative, of decays about the law. amplitude_scatter: relative,
    of amplitudes about σψ. foreign_hz: strong lines that are no mode. assumed: what was taken from the guess. warnings:
    one line each. log_spectral_db: distance of recording and synthesis (signal/log_spectral.py), mean over the fitted
    strikes; -1 where there is nothing to compare. radiation: what α and β are without, or with. evidence: what was
    recorded of each object, those without a mesh included. takes: how far the prediction of each take is, of those held
    out where there are any. dimension_tolerance: of the shapes, relative, in γ's variance.
    poisson_sd_of_dimensions: what it brings to ν's.
    """

    case: Case
    fit: MaterialFit
    objects: tuple[ObjectFit, ...]
    youngs_pa: float
    density_kg_m3: float
    gain_sd: float
    damping_scatter: float
    frequency_scatter: float
    amplitude_scatter: float
    foreign_hz: Array
    assumed: tuple[str, ...]
    warnings: tuple[str, ...]
    log_spectral_db: float = -1.0
    radiation: RadiationIn = "damping"
    evidence: tuple[RecordedObject, ...] = ()
    takes: tuple[TakeDistance, ...] = ()
    dimension_tolerance: float = 0.0
    poisson_sd_of_dimensions: float = 0.0

    @property
    def has_material(self) -> bool:
        """Whether anybody says what is struck, by a shape or by a material: else no constant of one is known."""
        return bool(self.objects) or any(r.object in self.case.objects for e in self.evidence for r in e.recordings)

    def plays_modes(self, e: RecordedObject) -> bool:
        """Say whether an object's strikes at known places are played by the modes of its shape.

        They are where their gain is known and the lines are modes, not by chance; else by its lines, as struck on
        average.
        """
        return e.family is not None and bool(np.isfinite(self.gain_sd) and np.isfinite(self.fit.covariance[2, 2]))

    @property
    def worse_than_silence(self) -> bool:
        """Whether what is played is on average at least as far from the takes as silence is."""
        known = [t for t in self.takes if np.isfinite(t.predicted_db) and np.isfinite(t.silence_db)]
        return bool(known) and sum(t.predicted_db - t.silence_db for t in known) >= 0
