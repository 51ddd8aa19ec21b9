"""Options of the household, and the recipe that they make.

The recipe holds them by value, so that a data set's folder tells them apart and any process can draw from it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from sonic_bullet.apps.dataset.household.objects import KINDS
from sonic_bullet.apps.dataset.recipes import Recipe
from sonic_bullet.records.coerce import nearest
from sonic_bullet.records.errors import SceneError

PHYSICS = ("support", "room", "contact-time", "radiation", "chain")
"""What a set may be made without: the loss to hands and supports; the room; finite contacts (every striker is small,
light and hard); how well each mode radiates; the microphone's response and all noise."""


@dataclass(frozen=True, slots=True)
class HouseholdOptions:
    """What the household is drawn from.

    Parameters
    ----------
    objects
        How many shapes there are; clips of one differ in size, specimen and all else. 0: each clip has its own.
    counterfactual
        Whether a sample is a pair: two channels, as drawn and with exactly one cause changed.
    without
        Of `PHYSICS`, what is left out.
    kinds
        Of objects, of which they are drawn; (): all.
    materials
        Folder of preset files NAME.json that take the place of `made-NAME`, "": none.
    seconds
        Of a clip, in s.
    seed
        Of the objects: sets of one seed have the same ones.
    """

    objects: int = 0
    counterfactual: bool = False
    without: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    materials: str = ""
    seconds: float = 2.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the fields."""
        for name in self.kinds:
            if name not in KINDS:
                raise SceneError(f"the household has no {name}", nearest(name, list(KINDS)))
        for name in self.without:
            if name not in PHYSICS:
                raise SceneError(f"the household cannot be made without {name}", nearest(name, PHYSICS))


def recipe_of(options: HouseholdOptions) -> Recipe:
    """Return the recipe that draws with these options."""
    where = "sonic_bullet.apps.dataset.household"
    text = (
        f"from {where} import HouseholdOptions\n"
        f"from {where}.sounding import draw_scene\n\n"
        f"OPTIONS = {options!r}\n{_digest(options.materials)}\n\n"
        "def sample(rng):\n"
        "    return draw_scene(rng, OPTIONS)\n"
    )
    return Recipe("household.py", text, own=True)


def _digest(folder: str) -> str:
    """Return a line that changes with the presets of a folder."""
    if not folder:
        return ""
    found = hashlib.sha256()
    for file in sorted(Path(folder).glob("*.json")):
        found.update(file.name.encode() + file.read_bytes())
    return f"# presets: SHA-256 {found.hexdigest()}\n"


def household_recipe(name: str, *, seed: int, **given: Any) -> Recipe | None:
    """Return the household's recipe where it is asked for by name, else None.

    given: fields of `HouseholdOptions`; None and what is empty stand for their defaults. SceneError where another
    recipe was given some.
    """
    known = {field.name for field in fields(HouseholdOptions)}
    said = {key: value for key, value in given.items() if value}
    if name != "household":
        if said:
            raise SceneError(f"recipe {name} takes no {next(iter(said))}", "they are the household's: give `household`")
        return None
    assert said.keys() <= known
    if "materials" in said:
        said["materials"] = str(Path(said["materials"]).resolve())
    return recipe_of(HouseholdOptions(seed=seed, **said))
