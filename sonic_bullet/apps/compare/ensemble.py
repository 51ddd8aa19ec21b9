"""Is a change beyond chance? Run the scene many times, each body's start shifted by 0.1 mm along the support.

    A, 99 times -> features (99, k) ┐
    B           -> features (k,)    ┴-> T² of each of the 100 among all -> rank of B -> p = rank/100

A chaotic scene sounds different after the smallest change, so one run is not a reference. T² is the squared Mahalanobis
distance [Mahalanobis 1936] of a run's features from the mean of all 100, with their common covariance: all runs are
treated alike, so under the null hypothesis every rank is as likely (a permutation test), and B alarms in 1 of 100.
Features: contacts (episodes, impulse), log-spectral distance from the mean of the others, octave levels, signed level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.inputs.tree_difference import with_leaves
from sonic_bullet.apps.compare.sides import SceneSide, Side, run
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.machine.progress import report_progress, without_progress
from sonic_bullet.records import Array
from sonic_bullet.records.errors import CompareError
from sonic_bullet.session.scene_file import defines_build
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ, octave_power
from sonic_bullet.signal.short_time import power_spectrum
from sonic_bullet.simulators.calls import Call, ObjectId

RUNS = 99
"""Fewest runs in which a rank can be at the 1 % level."""


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """Shifted runs of a scene.

    Parameters
    ----------
    features : Array, shape (runs, k)
    spectra : Array, shape (runs, slices · bands)
    seconds
        Length of each run.
    rests
        Whether the scene is at rest then.
    """

    features: Array
    spectra: Array
    seconds: float
    rests: bool


@dataclass(frozen=True, slots=True)
class Audibility:
    """Rank of B's statistic among all runs, 1 the largest; p: rank / (runs + 1)."""

    statistic: float
    rank: int
    runs: int
    p: float
    beyond_chance: bool
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the audibility as JSON holds it."""
        return {"statistic": self.statistic, "rank": self.rank, "runs": self.runs, "p": self.p,
                "beyond_chance": self.beyond_chance, "note": self.note}  # fmt: skip

    @property
    def words(self) -> str:
        """The result in one line."""
        what = "beyond chance" if self.beyond_chance else "within chance"
        tail = f"; {self.note}" if self.note else ""
        asked = f"its distance from A is rank {self.rank} of {self.runs + 1}, among runs of A started 0.1 mm apart"
        return f"{what}: {asked} (p = {self.p:.2g}){tail}"


@dataclass(slots=True, eq=False)
class ShiftPlan:
    """A `Plan`: every moving body starts 0.1 mm away, along the support, in a direction of its own."""

    seed: int
    _count: int = 0

    def ahead_of(self, call: Call) -> tuple[list[Call], Mapping[str, Any] | None]:
        """Shift the start in calls that place a body, see `Plan`."""
        given = call.arguments
        place = {"createMultiBody": "basePosition", "loadURDF": "basePosition"}.get(call.name)
        if call.name == "resetBasePositionAndOrientation" and call.step == 0 and call.who is not None:
            return [], with_leaves(given, {("posObj",): self._moved(given["posObj"], call.who)})
        fixed = given.get("useFixedBase") or (call.name == "createMultiBody" and not given.get("baseMass"))
        if place is None or call.step or fixed:
            self._count += place is not None
            return [], given
        who = ObjectId("", self._count)
        self._count += 1
        return [], with_leaves(given, {(place,): self._moved(given.get(place, (0.0, 0.0, 0.0)), who)})

    def remaining_calls(self, step: int, name: str | None = None) -> list[Call]:
        """Return no calls, see `Plan`."""
        return []

    def _moved(self, place: Any, who: ObjectId) -> tuple[float, ...]:
        angle = np.random.default_rng([self.seed, who.serial]).uniform(0, 2 * np.pi)
        x, y, z = place
        shift_m = 1e-4
        return (x + shift_m * float(np.cos(angle)), y + shift_m * float(np.sin(angle)), z)


def ensemble(scene: SceneSide, runs: int = RUNS) -> Ensemble:
    """Run a scene with shifted starts.

    Raises
    ------
    CompareError
        It is a plain script, which sets its own starts.
    """
    if not defines_build(Path(scene.path)):
        raise CompareError(
            f"{scene.path} is a plain script: it has no ensemble", "write build(client), or leave --audible out"
        )
    seconds, rests = until_rest(scene)
    longer = replace(scene, seconds=seconds)

    def one(seed: int) -> tuple[Array, Array]:
        report_progress(f"run {seed} of {runs}")
        with without_progress():
            return measure_side(run(longer, "b", plan=ShiftPlan(seed)))

    found = parallel_map(one, range(1, runs + 1))
    return Ensemble(np.array([x for x, _ in found]), np.array([y for _, y in found]), seconds, rests)


def until_rest(scene: SceneSide) -> tuple[float, bool]:
    """Find how long to run a scene until all is at rest, and whether that is reached."""
    longest = 4  # Longest run to reach rest, as a multiple of the scene's own length
    side = run(scene, "a")
    assert side.log is not None
    first = seconds = side.log.duration_s
    for times in range(1, longest + 1):
        assert side.log is not None
        if at_rest(side.log):
            return seconds, True
        if times < longest:
            seconds = first * (times + 1)
            side = run(replace(scene, seconds=seconds), "a")
    return seconds, False


def at_rest(log: ContactLog) -> bool:
    """Tell whether no sounding body moves in the last tenth of a second."""
    count = max(2, round(0.1 / log.steps[-1].dt_s))
    one, other = log.steps[max(0, len(log.steps) - count)], log.steps[-1]
    if len(one.body) != len(other.body):
        return False
    sounds = np.array([log.bodies[i].material is not None for i in one.body], bool)
    rest_m = 1e-5  # largest motion of a resting body in the last tenth of a second
    return bool(np.abs(one.position_m - other.position_m)[sounds].max(initial=0) < rest_m)


def measure_side(side: Side) -> tuple[Array, Array]:
    """Return the features (k,) without the distance, and the log spectra (slices · bands,) of the distance."""
    assert side.log is not None
    x = side.sound.samples()
    spectra = _band_spectra(x, side.sr)
    mean = 10 * np.log10(np.mean(10 ** (spectra / 10), axis=0))
    level = 10 * np.log10(float(np.square(x).mean()) + 1e-12)
    return np.array([*_contacts(side.log), *mean, level]), spectra.ravel()


def _contacts(log: ContactLog) -> tuple[float, float]:
    """Return ln(1 + contact episodes), ln of the sum of impulses."""
    before: set[tuple[int, int]] = set()
    episodes, total = 0, 0.0
    for step in log.steps:
        row = step.contacts.row
        now = set(zip(row["a"].tolist(), row["b"].tolist(), strict=True))
        episodes += len(now - before)
        total += float(np.linalg.norm(row["impulse_n_s"], axis=1).sum())
        before = now
    return float(np.log1p(episodes)), float(np.log(total + 1e-12))


def _band_spectra(x: Array, sr: int) -> Array:
    """Return mean squares (slices, bands) in octave bands, dB, with a floor floor_db below the largest."""
    slices = 12
    n = x.shape[1] // slices
    frames = x[:, : n * slices].reshape(len(x), slices, n)
    power = power_spectrum(frames).sum(axis=0) / max(n, 1) ** 2
    freq = np.fft.rfftfreq(n, 1 / sr)
    bands = octave_power(power, freq, [f for f in AUDIBLE_OCTAVES_HZ if f < sr / 2**1.5])
    table = np.array(bands).T
    floor_db = -90.0
    return np.asarray(10 * np.log10(np.maximum(table, table.max(initial=0) * 10 ** (floor_db / 10)) + 1e-12))


def judge_run(known: Ensemble, features: Array, spectra: Array) -> Audibility:
    """Rank a run among those of an ensemble."""
    every = np.vstack([known.spectra, spectra])
    n = len(every)
    apart = np.sqrt(np.square((every - every.mean(axis=0)) * (n / (n - 1))).mean(axis=1))
    table = np.column_stack([np.vstack([known.features, features]), np.log(apart + 1e-9)])
    table = (table - table.mean(axis=0)) / (table.std(axis=0) + 1e-12)
    values, axes = np.linalg.eigh(np.cov(table.T))
    kept = values > 1e-6 * values.max()
    statistic = np.square(table @ axes[:, kept] / np.sqrt(values[kept])).sum(axis=1)
    rank = 1 + int((statistic[:-1] >= statistic[-1]).sum())
    note = "" if known.rests else "the scene does not come to rest: its end is cut in every run"
    significance = 0.01
    return Audibility(float(statistic[-1]), rank, n - 1, rank / n, rank / n <= significance, note)


def audible(a: Side, b: Side, known: Ensemble | None = None) -> Audibility:
    """Test whether B differs from an ensemble of A.

    Raises
    ------
    CompareError
        A is not a scene with a `build`.
    """
    if a.scene is None or b.scene is None:
        raise CompareError(f"{a.name} is no scene: it has no ensemble", "leave --audible out, or compare scenes")
    known = ensemble(a.scene) if known is None else known
    report_progress("B until it rests")
    return judge_run(known, *measure_side(run(replace(b.scene, seconds=known.seconds), "b")))
