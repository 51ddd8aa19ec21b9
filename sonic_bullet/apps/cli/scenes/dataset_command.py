"""Command `dataset`: many sounds with labels, from a recipe."""

from __future__ import annotations

import click

from sonic_bullet.apps.cli.output import (
    clean_stdout,
    folder_place,
    places,
    print_report,
    quiet_stderr,
    status,
    write_json,
)
from sonic_bullet.options.dataset import DatasetOptions


def run_dataset(recipe: str, options: DatasetOptions) -> None:
    """Run `dataset`; raises SonicBulletError."""
    (to,) = places(options.json_to)
    root = folder_place(options.folder)
    with clean_stdout(to) as echo, status(recipe):
        with quiet_stderr():
            from sonic_bullet.apps.dataset.household import household_recipe
            from sonic_bullet.apps.dataset.making import make_dataset
            from sonic_bullet.apps.dataset.recipes import read_recipe
        made = make_dataset(household_recipe(recipe, options) or read_recipe(recipe), root, options)
        print_report(made, echo)
    write_json(to, made.to_json())
    if made.failures:
        raise click.exceptions.Exit(1)
