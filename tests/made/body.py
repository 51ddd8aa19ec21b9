"""A plate whose modes are known in closed form, struck at five places and heard at one, as the diagnosis takes a body.

simply supported, a × b:  φ_mn = (2/√M) sin(mπx/a) sin(nπy/b),  f = (π/2) √(D/ρh) (m²/a² + n²/b²)
    [Leissa 1969, eq. 4.20]
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from sonic_bullet.effects import Effect
from sonic_bullet.files.cases import CaseObject, CaseRecording
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.lines.joint_lines import joint_lines
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Array, Material, ModalModel

SR = 16_000
SIDE_M = (0.21, 0.13)
MASS_KG = 0.4
FIRST_HZ = 330.0
STRIKES = ((0.31, 0.42), (0.72, 0.23), (0.14, 0.81), (0.55, 0.66), (0.88, 0.52))
SENSOR = (0.37, 0.29)
IMPULSE = (0.005, 0.01, 0.02, 0.04, 0.03)
ALPHA, BETA, GAIN = 30.0, 4e-8, 0.3


def plate(modes: int = 18) -> ModalModel:
    """Grid of 23 × 15 vertices; the strikes and the sensor are the last six."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 23), np.linspace(0, 1, 15), indexing="ij"))
    place = np.concatenate([np.stack([x, y], axis=1), np.array((*STRIKES, SENSOR))])
    a, b = SIDE_M
    pairs = [(m, n) for m in range(1, 12) for n in range(1, 9)]
    ratio = {p: (p[0] / a) ** 2 + (p[1] / b) ** 2 for p in pairs}
    chosen = sorted(pairs, key=ratio.__getitem__)[:modes]
    freq = np.array([FIRST_HZ * ratio[p] / ratio[(1, 1)] for p in chosen])
    shape = np.zeros((len(place), 3, modes))
    for k, (m, n) in enumerate(chosen):
        shape[:, 2, k] = 2 / np.sqrt(MASS_KG) * np.sin(m * np.pi * place[:, 0]) * np.sin(n * np.pi * place[:, 1])
    corner = np.arange(23 * 15).reshape(23, 15)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    face = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    vertex = np.column_stack([place * SIDE_M, np.zeros(len(place))])
    return ModalModel(freq, np.zeros(modes), shape, vertex, face, np.zeros(len(face)), 1e-4, MASS_KG)


def struck(model: ModalModel | None = None, lines: Any = None, signals: Array | None = None) -> StruckBody:
    """The plate as a body; with lines and signals one that was fitted."""
    model = model or plate()
    recordings = tuple(
        CaseRecording(
            Path(f"strike-{i}.wav"),
            None,
            "plate",
            "fit",
            (p[0] * SIDE_M[0], p[1] * SIDE_M[1], 0.0),
            (0.0, 0.0, -1.0),
            j,
        )
        for i, (p, j) in enumerate(zip(STRIKES, IMPULSE, strict=True))
    )
    direction = np.array([[0.0, 0.0, -1.0]] * len(STRIKES) + [[0.0, 0.0, 1.0]])
    recorded, line = None, np.full(model.mode_count, -1)
    if lines is not None:
        guess = Material.isotropic("glass", youngs_pa=7e10, poisson=0.22, density_kg_m3=2500)
        thing = CaseObject("plate", None, 1.0, "glass")
        recorded = Recorded(thing, guess, recordings, lines, None, None, signals, SR)
        for k, f in enumerate(model.freq_hz):
            near = np.abs(lines.freq_hz / f - 1)
            if len(near) and near.min() < 0.006:
                line[k] = int(near.argmin())
    return StruckBody(
        "plate",
        recordings,
        model,
        direction,
        np.array(IMPULSE),
        "velocity",
        cast(Family, object()),
        np.zeros(model.mode_count),
        line,
        recorded,
    )


def truth(*effects: Effect) -> Hypothesis:
    """The plate's own hypothesis."""
    return Hypothesis(ALPHA, BETA, GAIN, effects)


def recorded(
    *effects: Effect, seconds: float = 0.7, noise: float = 2e-5, seed: int = 5, model: ModalModel | None = None
) -> StruckBody:
    """The body with the effects as a recording shows it: played, noise added, lines found. Of the plate, once."""
    if model is not None or not all(isinstance(effect, Hashable) for effect in effects):
        return _recorded(effects, seconds, noise, seed, model)
    return _recorded_once(effects, seconds, noise, seed, None)


def _recorded(
    effects: tuple[Effect, ...], seconds: float, noise: float, seed: int, model: ModalModel | None
) -> StruckBody:
    plain = struck(model)
    n = int(seconds * SR)
    observed = replace(
        plain,
        recorded=cast(
            Recorded,
            Recorded(
                CaseObject("plate", None, 1.0, None), cast(Material, None), plain.recordings, None, None, None, None, SR
            ),
        ),
    )  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    played = predict(truth(*effects), observed).sounds(range(len(STRIKES)), n, SR)
    signals = np.stack([sound + noise * rng.standard_normal(n) for sound in played])
    lines = joint_lines(signals, SR, band_hz=(50.0, 7_500.0))
    return struck(model, lines, signals)


_recorded_once = lru_cache(64)(_recorded)
"""Lines take a second to find, and what is recorded is never written to."""
