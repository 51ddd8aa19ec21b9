"""A job and what it gives: one sample, a function of recipe, seed and number alone.

Job -> generator of (seed, number) -> Recipe.draw -> world, listener, steps -> Sample
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.apps.dataset.contact_labels import contact_labels, log_digest
from sonic_bullet.apps.dataset.recipes import Recipe, read_recipe
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SceneError, SceneWarning, SonicBulletError


@dataclass(frozen=True, slots=True)
class Job:
    """A sample that is to be made."""

    recipe: Recipe
    seed: int
    number: int
    sr: int


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One sample. sound: (channels, n) float32 in pascals; labels: its line of the manifest, values of JSON."""

    number: int
    sr: int
    sound: Array
    labels: Mapping[str, Any]


@one_thread()
def make_sample(job: Job) -> Sample:
    """Make one sample; SceneError where the recipe fails or its scene makes no sound."""
    scene = job.recipe.draw(np.random.default_rng([job.seed, job.number]))
    seed = int(np.random.SeedSequence([job.seed, job.number, 1]).generate_state(1)[0])  # of the surfaces
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        sound, log = scene.play(job.sr, seed, job.recipe.call)
    if not np.any(sound):
        raise SceneError(
            f"recipe '{job.recipe.name}' makes no sound", "let a body of its cast be struck, and give it a microphone"
        )
    labels = {
        "number": job.number,
        "object": scene.object,
        "sr": job.sr,
        "seconds": sound.shape[1] / job.sr,
        "channels": len(sound),
        "peak_pa": float(np.abs(sound).max()),
        "bodies": {b.name: b.material.name for b in log.bodies if b.material is not None},
        "contacts": contact_labels(log),
        "parameters": dict(scene.parameters),
        "seed": [job.seed, job.number],
        "recipe_sha256": job.recipe.sha256,
        "log_sha256": log_digest(log),
        "versions": dict(log.versions),
    }
    return Sample(job.number, job.sr, sound.astype(np.float32), labels)


def warm_up(job: Job) -> None:
    """Make one sample, so that processes forked from this one have its libraries: the job's, or of the ready recipe.

    Loaded in each of them, they would take six times as long as a sample. Only a recipe of the package runs in here.
    """
    try:
        make_sample(job if job.recipe.own else Job(read_recipe("impacts"), 0, 0, 8000))
    except SonicBulletError:
        return  # its own process says why
