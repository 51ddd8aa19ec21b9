"""The household's recipe: four lines that hold its options by value.

So a data set's folder tells them apart, and any process can draw from it.
"""

from __future__ import annotations

from dataclasses import replace

from sonic_bullet.apps.dataset.household.clips import EXCITATIONS, ROLLED, ROLLING_KINDS, SHAKEN, SHAKEN_KINDS
from sonic_bullet.apps.dataset.household.objects import KINDS
from sonic_bullet.apps.dataset.recipes import Recipe
from sonic_bullet.options.dataset import DatasetOptions, HouseholdOptions
from sonic_bullet.options.option import given_flags
from sonic_bullet.records.coerce import nearest
from sonic_bullet.records.errors import SceneError

PHYSICS = ("support", "room", "contact-time", "radiation", "chain")
"""What a set may be made without."""


def household_recipe(name: str, options: DatasetOptions) -> Recipe | None:
    """Return the household's recipe where it is asked for by name, else None.

    Raises
    ------
    SceneError
        Another recipe was given the household's options, or one of them names what there is not.
    """
    if name != "household":
        given = given_flags(options.household)
        if given:
            raise SceneError(f"recipe {name} takes no {given[0]}", "it is the household's: give `household`")
        return None
    return recipe_of(replace(options.household, seed=options.seed))


def recipe_of(options: HouseholdOptions) -> Recipe:
    """Return the recipe that draws with these options; raises SceneError."""
    for name in options.kinds:
        if name not in KINDS:
            raise SceneError(f"the household has no {name}", nearest(name, list(KINDS)))
    for name in options.without:
        if name not in PHYSICS:
            raise SceneError(f"the household cannot be made without {name}", nearest(name, PHYSICS))
    for name in options.excitations:
        if name not in EXCITATIONS:
            raise SceneError(f"nothing is {name} in the household", nearest(name, EXCITATIONS))
    for excitation, does, kinds in ((ROLLED, "rolls", ROLLING_KINDS), (SHAKEN, "holds what rattles", SHAKEN_KINDS)):
        if excitation in options.excitations and not (options.kinds and set(options.kinds) <= set(kinds)):
            raise SceneError(f"not all that is drawn {does}", f"give --kind, of {', '.join(kinds)}")
    text = (
        "from sonic_bullet.apps.dataset.household.sounding import draw_scene\n"
        "from sonic_bullet.options.dataset import HouseholdOptions\n\n"
        f"OPTIONS = {options!r}\n\n\n"
        "def sample(rng):\n"
        "    return draw_scene(rng, OPTIONS)\n"
    )
    return Recipe("household.py", text, own=True)
