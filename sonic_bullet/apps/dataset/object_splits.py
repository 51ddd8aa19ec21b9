"""Which split an object is in: names of the objects, in the order of their first sample -> name of a split each.

The next object goes to the split that lacks most of its share, so that after any number of objects each split has its
share to within one object, and more samples move none. The order is that of the samples' numbers, drawn beforehand:
neither what fails nor what was done first has a part in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

import numpy as np

from sonic_bullet.apps.dataset.recipes import Recipe
from sonic_bullet.apps.dataset.sample_folder import SampleFolder
from sonic_bullet.apps.jobs.job_processes import Failure, attempt, run_jobs

A_BLOCK = 1000
"""Samples drawn in one process: a process costs as much as some hundred draws."""


def splits_of(names: Iterable[str | None], shares: Mapping[str, float]) -> dict[str, str]:
    """Return the split of each object. names: of all samples, by number; None: it has none."""
    splits = dict[str, str]()
    taken = dict.fromkeys(shares, 0)
    for name in names:
        if name is not None and name not in splits:
            splits[name] = max(shares, key=lambda split: shares[split] * (len(splits) + 1) - taken[split])
            taken[splits[name]] += 1
    return splits


def object_names(
    recipe: Recipe, seed: int, kept: SampleFolder, count: int, workers: int, limit_s: float
) -> list[str | None]:
    """Return whose sound each sample below ``count`` is: by its labels where it is kept, else drawn anew.

    None where the recipe fails to draw, which fails its sample, too.
    """
    names: list[str | None] = [None] * count
    draw = partial(_draw_split, recipe, seed)
    for one in kept.labels(range(count)):
        names[one["number"]] = one["object"]
    missing = {number for number, name in enumerate(names) if name is None}
    blocks = sorted({number // A_BLOCK for number in missing})
    for block, found in run_jobs(partial(_block, draw, count), blocks, workers, limit_s, tries=1):
        numbers = range(block * A_BLOCK, min(count, (block + 1) * A_BLOCK))
        if isinstance(found, Failure):  # it never ends, or its process did: one at a time
            drawn = dict(run_jobs(draw, sorted(missing.intersection(numbers)), workers, limit_s, tries=1))
        else:
            drawn = dict(zip(numbers, found, strict=True))
        for number in missing.intersection(numbers):
            name = drawn[number]
            names[number] = name if isinstance(name, str) else None
    return names


def _draw_split(recipe: Recipe, seed: int, number: int) -> str:
    return str(recipe.draw(np.random.default_rng([seed, number])).object)


def _block(draw: partial[str], count: int, block: int) -> list[str | Failure]:
    return [attempt(draw, number) for number in range(block * A_BLOCK, min(count, (block + 1) * A_BLOCK))]
