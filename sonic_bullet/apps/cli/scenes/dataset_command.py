"""Command `dataset`: many sounds with labels, from a recipe."""

from __future__ import annotations

from typing import Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.parameters import cores, json_option


@click.command(epilog=EXAMPLES["dataset"])
@click.argument("recipe", metavar="RECIPE.py|impacts|household")
@click.option("-o", "--output", "folder", required=True, metavar="DIR", help="Folder of the data set.")
@click.option("--count", type=click.IntRange(1), required=True, metavar="N", help="How many samples.")
@click.option(
    "--first", type=click.IntRange(0, 10**12), default=0, metavar="K",
    help="Number of the first one: runs into folders of their own make one data set. [default: 0]",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=0, show_default=True, metavar="S")
@click.option(
    "--workers", type=click.IntRange(1, 1024), metavar="N", help="Processes at once. [default: one a core]"
)  # fmt: skip
@click.option("--sr", type=click.IntRange(8000, 384_000), default=48_000, show_default=True, metavar="HZ")
@click.option(
    "--limit", "limit_s", type=click.FloatRange(0, min_open=True), default=300.0, show_default=True, metavar="S",
    help="Wall time a sample may take.",
)  # fmt: skip
@click.option(
    "--format", "formats", multiple=True, metavar="NAME",
    help="A layout for loaders, in DIR/NAME beside the samples: audiofolder, lerobot, webdataset or zarr.",
)  # fmt: skip
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Of a Dask cluster whose workers make the samples.")
@click.option("--shares", metavar="A,B,C", help="Of the objects in train, validation, test. [default: 8,1,1]")
@click.option(
    "--objects", type=click.IntRange(0), metavar="N", help="household: how many shapes. [default: one a sample]"
)  # fmt: skip
@click.option("--kind", "kinds", multiple=True, metavar="NAME", help="household: such objects alone, as cup or tile.")
@click.option(
    "--counterfactual", is_flag=True,
    help="household: pairs, two channels each, that differ in one cause: material, size, wall, hammer, height, "
    "support or room.",
)  # fmt: skip
@click.option(
    "--without", multiple=True, metavar="NAME",
    help="household: leave out support, room, contact-time, radiation or chain.",
)  # fmt: skip
@click.option(
    "--materials", metavar="DIR", help="household: presets NAME.json in place of the package's, as made-wood.json."
)  # fmt: skip
@json_option
def dataset(
    recipe: str,
    folder: str,
    *,
    count: int,
    first: int,
    seed: int,
    workers: int | None,
    sr: int,
    limit_s: float,
    formats: tuple[str, ...],
    shares: str | None,
    scheduler: str | None,
    json_to: str | None,
    **household: Any,
) -> None:
    """Make a data set: audio, contacts as labels, parameters and provenance of each sample, split by object."""
    from sonic_bullet.apps.cli.output import (
        clean_stdout,
        folder_place,
        places,
        print_report,
        quiet_stderr,
        status,
        write_json,
    )

    (to,) = places(json_to)
    root = folder_place(folder)
    with clean_stdout(to) as echo, status(recipe):
        with quiet_stderr():
            from sonic_bullet.apps.dataset.household.options import household_recipe
            from sonic_bullet.apps.dataset.making import make_dataset
            from sonic_bullet.apps.dataset.object_splits import as_shares
            from sonic_bullet.apps.dataset.recipes import read_recipe
        made = make_dataset(
            household_recipe(recipe, seed=seed, **household) or read_recipe(recipe), root, count=count, first=first,
            seed=seed, sr=sr, workers=workers or cores(), limit_s=limit_s, formats=formats,
            shares=as_shares(shares), scheduler=scheduler,
        )  # fmt: skip
        print_report(made, echo)
    write_json(to, made.to_json())
    if made.failures:
        raise click.exceptions.Exit(1)
