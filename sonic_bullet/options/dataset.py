"""Options of `dataset`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from sonic_bullet.options.option import Options, group, option, require_option
from sonic_bullet.options.render import DEFAULT_SR, SAMPLE_RATES_HZ, json_option
from sonic_bullet.records.errors import SceneError, SonicBulletError

SPLITS = ("train", "validation", "test")


def read_shares(text: str) -> Mapping[str, float]:
    """Read the share of each split from a text such as ``8,1,1``. Raises ValueError."""
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(SPLITS) or min(numbers) < 0 or not 0 < sum(numbers) < float("inf"):
        raise ValueError(f"shares are {text[:60]!r}; give three numbers for {', '.join(SPLITS)}: 8,1,1")
    return {split: number / sum(numbers) for split, number in zip(SPLITS, numbers, strict=True)}


DEFAULT_SHARES = "8,1,1"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HouseholdOptions(Options):
    """Recipe household.

    seconds: of a clip. seed: of the objects, so that sets of one seed have the same ones.
    """

    error: ClassVar[type[SonicBulletError]] = SceneError
    objects: int | None = option(
        None,
        "How many shapes there are; clips of one differ in size, specimen and all else.",
        metavar="N",
        least=1,
        unset="one a sample",
    )
    kinds: tuple[str, ...] = option((), "Such objects alone, as cup or tile.", "--kind", metavar="NAME")
    excitations: tuple[str, ...] = option(
        (),
        "What happens, of finger, stick, metal (which strike), dropped, rolled, scraped, shaken.",
        "--excitation",
        metavar="NAME",
        unset="struck or dropped",
    )
    counterfactual: bool = option(
        False,
        "Pairs that differ in one cause: material, size, wall, hammer, height, support, room or none.",
    )
    takes: int = option(5, "Of each of a pair: a channel each, first those of the one.", metavar="N", least=1, most=32)
    without: tuple[str, ...] = option(
        (),
        "Leave out a piece of physics: support (its loss), room, contact-time (each striker is small, light and hard), "
        "radiation (all modes are as loud), or chain (the microphone's response, and noise).",
        metavar="NAME",
    )
    seconds: float = 2.0
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DatasetOptions(Options):
    """Samples and outputs."""

    folder: str = field(metadata=require_option("Folder of the data set.", "-o", "--output", metavar="DIR"))
    count: int = field(metadata=require_option("How many samples.", metavar="N", least=1))
    first: int = option(
        0,
        "Number of the first one: runs into folders of their own make one data set.",
        metavar="K",
        least=0,
        most=10**12,
    )
    seed: int = option(0, "Seed of all that is drawn.", metavar="S", least=0, most=2**63 - 1)
    workers: int | None = option(None, "Processes at once.", metavar="N", least=1, most=1024, unset="one a core")
    sr: int = option(DEFAULT_SR, "Sample rate in Hz.", metavar="HZ", least=SAMPLE_RATES_HZ[0], most=SAMPLE_RATES_HZ[1])
    limit_s: float = option(300.0, "Wall time in s that a sample may take.", "--limit", metavar="S", above=0)
    formats: tuple[str, ...] = option(
        (),
        "A layout for loaders, in DIR/NAME beside the samples: audiofolder, lerobot, webdataset or zarr.",
        "--format",
        metavar="NAME",
    )
    scheduler: str | None = option(None, "Of a Dask cluster whose workers make the samples.", metavar="tcp://HOST:PORT")
    shares: Mapping[str, float] | None = option(
        None, "Of the objects in train, validation, test.", metavar="A,B,C", read=read_shares, unset=DEFAULT_SHARES
    )
    household: HouseholdOptions = group(HouseholdOptions)
    json_to: str | None = json_option()
