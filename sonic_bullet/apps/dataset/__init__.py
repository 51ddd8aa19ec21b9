"""Data sets: thousands of sounds with labels, from a recipe and a seed.

    NAME.py, or `impacts` -> Recipe: its text, by value
    recipe, seed, number (a job) -> sample(rng) -> DatasetScene -> build(client) -> listener, steps -> Sample: sound in
        pascals, contacts as labels, parameters, provenance
    jobs -> processes or a Dask cluster (`sonic_bullet.apps.jobs`) -> Sample, or the reason why there is none
        -> SampleFolder: NAME.wav, then NAME.json, each renamed when whole -> manifest.jsonl, failures.jsonl
        -> layouts of loaders (`sonic_bullet.apps.dataset.loaders`)

A sample depends on recipe, seed and number alone, so that workers, order and interruptions change no byte, and a job
whose NAME.json is there is never done again.
"""

from sonic_bullet.apps.dataset.recipes import DatasetScene
from sonic_bullet.session.known_shapes import KnownShape, known_shape

__all__ = ["DatasetScene", "KnownShape", "known_shape"]
