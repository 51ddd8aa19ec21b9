"""Baseline of a scene's sound in a small file, and comparison of a later version with it.

    scene -> digest of its samples, measurements, ensemble, commit, reason, versions -> NAME.json
    NAME.json + scene -> the same samples, or within chance, or the changes

The file holds no sound. Where the commit still exists, the scene as it was is run again to name the cause.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.apps.compare.ensemble import RUNS, Audibility, Ensemble, ensemble, judge_run, measure_side
from sonic_bullet.apps.compare.outcome.sound_effects import band_levels, level_words, onsets_s, t60_s
from sonic_bullet.apps.compare.revisions import changed_files, head
from sonic_bullet.apps.compare.sides import SceneSide, Side, run
from sonic_bullet.apps.compare.tolerance import (
    Closeness,
    SoundMeasures,
    as_tolerance,
    closeness,
    compared_words,
    measure_sound,
    passes,
)
from sonic_bullet.files.storage.json_records import read_record, write_record
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError
from sonic_bullet.session.scene_file import defines_build
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ

BASELINE_FOLDER = "sonic_baselines"
BASELINE_FORMAT = "sonic_bullet baseline 1"


class SceneBaseline(msgspec.Struct, frozen=True, omit_defaults=True):
    """A baseline; see the module.

    Parameters
    ----------
    commit
        Of the scene's repository; "": none.
    clean
        The scene was as in that commit.
    features, spectra
        Of the ensemble, empty for a plain script.
    seconds, rests
        How long it ran, and whether it was at rest then.
    client
        Id of the physics client that was chosen.
    """

    format: str
    scene: str
    reason: str
    commit: str
    clean: bool
    versions: dict[str, str]
    sr: int
    channels: int
    frames: int
    samples_sha256: str
    onsets_s: list[float]
    t60_s: float | None
    band_hz: list[float]
    band_db: list[float | None]
    seconds: float = 0.0
    rests: bool = False
    features: list[list[float]] = []
    spectra: list[list[float]] = []
    client: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BaselineCheck:
    """A scene compared with its baseline.

    Parameters
    ----------
    same
        Samples are equal.
    audible
        Position within the ensemble; None: there is none, or it was not needed.
    words
        One line for each change.
    closeness
        See `Comparison`.
    """

    baseline: SceneBaseline
    side: Side
    same: bool
    audible: Audibility | None
    words: tuple[str, ...]
    closeness: Closeness | None = None

    @property
    def passed(self) -> bool:
        """Whether it counts as the same."""
        return passes(self.same, self.closeness, self.audible)

    @property
    def compared(self) -> str:
        """What was compared, in one line: bodies, events, seconds, tolerance."""
        return compared_words(self.side, self.same, self.closeness)


def baseline_place(scene: str | Path) -> Path:
    """Return the default place of a scene's baseline, in a folder beside the scene."""
    return Path(scene).resolve().parent / BASELINE_FOLDER / f"{Path(scene).stem}.json"


def samples_digest(sound: KeptSound) -> str:
    """Hash the samples of a sound."""
    made = hashlib.sha256()
    for block in sound.blocks():
        made.update(np.ascontiguousarray(block).tobytes())
    return made.hexdigest()


def make_baseline(scene: str | Path, reason: str, runs: int = RUNS, client: int | None = None) -> SceneBaseline:
    """Run a scene and make its baseline, heard by that client; raises what running it does."""
    side = run(SceneSide(scene, client=client), "a")
    assert side.log is not None
    x, place = side.sound.samples(), Path(scene).resolve()
    levels = band_levels(x, side.sr)
    many: dict[str, Any] = {}
    if defines_build(place) and runs:
        known = ensemble(SceneSide(scene, client=client), runs)
        many = {
            "seconds": known.seconds, "rests": known.rests,
            "features": np.round(known.features, 4).tolist(), "spectra": np.round(known.spectra, 1).tolist(),
        }  # fmt: skip
    return SceneBaseline(
        BASELINE_FORMAT,
        place.name, reason, head(place.parent), not changed_files(place.parent), dict(side.log.versions),
        side.sr, len(x), x.shape[1], samples_digest(side.sound), onsets_s(x, side.sr), t60_s(x, side.sr),
        list(AUDIBLE_OCTAVES_HZ[: len(levels)]), [round(float(v), 3) if np.isfinite(v) else None for v in levels],
        **many, client=client,
    )  # fmt: skip


def write_baseline(path: str | Path, baseline: SceneBaseline) -> None:
    """Write a baseline, whole or not at all; raises FileError."""
    write_record(path, baseline)


def read_baseline(path: str | Path) -> SceneBaseline:
    """Read a baseline; raises FileError."""
    remedy = "make it anew: sonic-bullet baseline"
    return read_record(path, SceneBaseline, "baseline", FileError, remedy, version=BASELINE_FORMAT, most_bytes=4 << 20)


def check_baseline(baseline: SceneBaseline, scene: str | Path, tolerance_db: float | None = None) -> BaselineCheck:
    """Compare the scene as it is now with a baseline; raises what running it does.

    tolerance_db: of octave levels, where samples need not be equal.
    """
    asked = SceneSide(scene, sr=baseline.sr, client=baseline.client)
    side = run(asked, "b")
    assert side.log is not None
    if samples_digest(side.sound) == baseline.samples_sha256:
        return BaselineCheck(baseline, side, True, None, ())
    words = [
        f"{name} {baseline.versions.get(name)} → {version}: another version's samples may be others"
        for name, version in side.log.versions.items()
        if baseline.versions.get(name) != version
    ]
    audible, close = None, None
    if tolerance_db is not None:
        kept = SoundMeasures(
            baseline.frames / baseline.sr, baseline.channels, len(baseline.onsets_s), tuple(baseline.band_db)
        )
        close = closeness(kept, measure_sound(side.sound.samples(), side.sr), as_tolerance(tolerance_db))
    elif baseline.features:
        features, spectra = np.array(baseline.features), np.array(baseline.spectra)
        known = Ensemble(features, spectra, baseline.seconds, baseline.rests)
        audible = judge_run(known, *measure_side(run(replace(asked, seconds=baseline.seconds), "b")))
    return BaselineCheck(baseline, side, False, audible, (*words, *_changes(baseline, side)), close)


def _changes(baseline: SceneBaseline, side: Side) -> list[str]:
    x = side.sound.samples()
    found = []
    if x.shape != (baseline.channels, baseline.frames):
        lasts = f"length {baseline.frames / baseline.sr:.4g} → {x.shape[1] / side.sr:.4g} s"
        found.append(f"{lasts}, channels {baseline.channels} → {len(x)}")
    change = [
        (f, new - old)
        for f, old, new in zip(baseline.band_hz, baseline.band_db, band_levels(x, side.sr).tolist(), strict=False)
        if old is not None and np.isfinite(new)
    ]
    if change:
        f, most = max(change, key=lambda pair: abs(pair[1]))
        found.append(f"it is {level_words(most)} than the baseline in the octave at {f:g} Hz, where they differ most")
    onsets, t60 = onsets_s(x, side.sr), t60_s(x, side.sr)
    if len(onsets) != len(baseline.onsets_s):
        found.append(f"{len(baseline.onsets_s)} → {format_count(len(onsets), 'onset')}")
    if t60 is not None and baseline.t60_s is not None and abs(t60 / baseline.t60_s - 1) > 0.005:
        found.append(f"T60 {baseline.t60_s:.3g} → {t60:.3g} s")
    return found
