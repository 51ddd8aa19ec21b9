"""A run: the jobs that are not done yet -> processes -> folder -> lists and summary."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from sonic_bullet.apps.dataset.loaders.layouts import check_formats, write_layout
from sonic_bullet.apps.dataset.object_splits import object_names, splits_of
from sonic_bullet.apps.dataset.recipes import Recipe
from sonic_bullet.apps.dataset.sample_folder import SampleFolder, open_folder
from sonic_bullet.apps.dataset.samples import Job, Sample, make_sample, warm_up
from sonic_bullet.apps.jobs.job_driver import cores, finish_jobs, open_workers
from sonic_bullet.files.levels import check_sr
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.dataset import DEFAULT_SHARES, DatasetOptions, read_shares
from sonic_bullet.records.counts import format_count
from sonic_bullet.session.run_recorder import package_versions


@dataclass(frozen=True, slots=True)
class DatasetSummary:
    """What a run made.

    made: in this run; samples, objects: in the folder, by split; failures: reasons by number; layouts: folders by
    format.
    """

    made: int
    samples: Mapping[str, int]
    objects: Mapping[str, int]
    failures: Mapping[int, str] = field(default_factory=dict)
    layouts: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return its fields."""
        return asdict(self)

    def lines(self) -> list[str]:
        """Describe it, a line a thing."""
        total = sum(self.samples.values())
        parts = [f"{n} {split} of {format_count(self.objects[split], 'object')}" for split, n in self.samples.items()]
        listed = [f"sample {number}: {reason}" for number, reason in sorted(self.failures.items())[:10]]
        rest = len(self.failures) - len(listed)
        return [
            f"{format_count(total, 'sample')}, {self.made} made now: {', '.join(parts) or 'none'}",
            *listed,
            *([f"{rest} more without sound, in failures.jsonl"] if rest > 0 else []),
            *(f"{name}: {place}" for name, place in self.layouts.items()),
        ]


def make_dataset(recipe: Recipe, folder: str | os.PathLike[str], options: DatasetOptions) -> DatasetSummary:
    """Make those of the samples asked for that the folder has not.

    Raises SonicBulletError where the folder cannot be used or written. What was finished is kept and listed, as after
    an interrupt.
    """
    count, seed, sr, formats = options.count, options.seed, check_sr(options.sr), options.formats
    shares, limit_s, workers = (
        options.shares or read_shares(DEFAULT_SHARES),
        options.limit_s,
        options.workers or cores(),
    )
    made_by = {
        "recipe": recipe.name,
        "recipe_sha256": recipe.sha256,
        "seed": seed,
        "sr": sr,
        "shares": dict(shares),
        "versions": package_versions(),
    }
    check_formats(formats)
    numbers = range(options.first, options.first + count)
    job = partial(_make, recipe, seed, sr)
    with open_workers(workers, limit_s, options.scheduler) as crew, open_folder(folder, made_by) as kept:
        missing = [number for number in numbers if not kept.is_done(number)]
        splits, unmet = dict[str, str](), set[str | None]()

        def prepare() -> None:
            if crew.cluster is None:
                report_progress("libraries and a first sample")
                warm_up(Job(recipe, seed, missing[0], sr))
            report_progress("objects")
            names = object_names(recipe, seed, kept, numbers.stop, workers, limit_s)
            splits.update(splits_of(names, shares))
            unmet.update({names[number] for number in missing} - {names[n] for n in set(numbers) - set(missing)})

        def keep(number: int, made: Sample) -> str | None:
            if made.labels["object"] not in splits:
                return "the recipe drew another object the second time; draw all by rng"
            kept.keep(made, splits[made.labels["object"]])
            unmet.discard(made.labels["object"])
            return None

        def list_failure(number: int, failed: Mapping[int, str]) -> None:
            if number in failed:
                kept.list_failure(number, failed[number])

        def describe() -> str:
            new = format_count(len(unmet - {None}), "object")
            return f"; {new} to come, whose first samples take longest" if unmet else ""

        made, failures = finish_jobs(
            job, missing, crew, count=count, nouns="samples", place=os.fspath(folder), keep=keep,
            write_lists=lambda failed: kept.write_lists(numbers, failed), update_lists=list_failure, prepare=prepare,
            describe=describe,
        )  # fmt: skip
        layouts = {name: str(write_layout(name, kept, numbers)) for name in dict.fromkeys(formats)}
        return _summarise(kept, numbers, made, failures, layouts)


def _make(recipe: Recipe, seed: int, sr: int, number: int) -> Sample:
    return make_sample(Job(recipe, seed, number, sr))


def _summarise(
    kept: SampleFolder, numbers: range, made: int, failures: Mapping[int, str], layouts: Mapping[str, str]
) -> DatasetSummary:
    samples, objects = Counter[str](), dict[str, set[str]]()
    one: dict[str, Any]
    for one in kept.labels(numbers):
        samples[one["split"]] += 1
        objects.setdefault(one["split"], set()).add(one["object"])
    return DatasetSummary(
        made, dict(samples), {split: len(names) for split, names in objects.items()}, failures, layouts
    )
