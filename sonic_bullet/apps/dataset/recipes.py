"""Recipes: Python files that draw a scene from a random generator.

    NAME.py with  sample(rng) -> DatasetScene
    or with       parameters(rng) -> dict  and  build(client, **parameters) -> cast  [SECONDS, MICROPHONE]

The second is a scene of `sonic_bullet.scene` with parameters; its "object", where it has one, names the object.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.machine.progress import without_progress
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import store
from sonic_bullet.records.coerce import as_call, as_number, as_text, nearest, quote
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session import attach
from sonic_bullet.session.arguments import as_sensors
from sonic_bullet.session.scene_file import user_code
from sonic_bullet.simulators import direct_client

DEFAULT_SECONDS = 2.0


@runtime_checkable
class DrawnScene(Protocol):
    """What a recipe draws."""

    @property
    def object(self) -> str:
        """Whose sound it is: samples of one object are in one split."""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """What was drawn, by name: values of JSON, kept with the sample."""

    def play(self, sr: int, seed: int, call: Callable[..., Any]) -> tuple[Array, ContactLog]:
        """Return the sound (channels, n) in pascals and the log.

        seed: of the surfaces; call: calls a function of the recipe, so that its failure names the line.
        """


@dataclass(frozen=True, slots=True, eq=False)
class DatasetScene:
    """One scene that a recipe drew.

    Parameters
    ----------
    build
        ``build(client)`` sets up an empty PyBullet world and returns its cast, a dictionary from bodies to materials or
        to keywords of `Listener.add`.
    parameters
        What was drawn, by name: values of JSON, kept with the sample.
    object
        Whose sound it is: samples of one object are in one split.
    seconds
        Of physics and of sound.
    microphones
        As of `attach`.
    """

    build: Callable[[Any], Mapping[Any, Any]]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    object: str = "object"
    seconds: float = DEFAULT_SECONDS
    microphones: MicrophoneLike = DEFAULT_MICROPHONE

    def __post_init__(self) -> None:
        """Check the fields."""
        if as_call(self.build, "build") is None:
            raise SceneError("build is None", "give a function of a client that returns a cast")
        if not isinstance(self.parameters, Mapping):
            raise SceneError(f"parameters is {quote(self.parameters)}", "give a dictionary of values of JSON")
        try:
            json_bytes(dict(self.parameters))
        except (TypeError, ValueError) as error:
            raise SceneError(f"parameters hold no values of JSON: {error}", "give numbers, texts and lists") from None
        seconds = as_number(self.seconds, "seconds", "give seconds above 0", above=0, most=3600, error=SceneError)
        as_text(self.object, "object", "give a name", error=SceneError)
        store(self, seconds=seconds, microphones=as_sensors(self.microphones, "microphones"))

    def play(self, sr: int, seed: int, call: Callable[..., Any]) -> tuple[Array, ContactLog]:
        """Step its world and listen."""
        client = direct_client()
        cast = call(self.build, client)
        if not isinstance(cast, Mapping):
            raise SceneError(f"build(client) returned {type(cast).__name__}", "return a dict from bodies to materials")
        with attach(client, sr=sr, seed=seed, microphone=self.microphones) as listener:
            with without_progress():
                listener.add_all(cast)
            while listener.time_s < self.seconds - 1e-9:
                client.stepSimulation()
            listener.finish()
            sound, log = listener.sound(), listener.contacts
        client.disconnect()
        return sound, log


@dataclass(frozen=True, slots=True)
class Recipe:
    """Text of a recipe, by value: any process can run it.

    path: named in messages, and its ``__file__``; own: it is the package's, which neither crashes nor hangs.
    """

    path: str
    text: str
    own: bool = False

    @property
    def sha256(self) -> str:
        """SHA-256 of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def name(self) -> str:
        """Name of its file."""
        return Path(self.path).name

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of the recipe; SceneError names the line that failed."""
        return user_code(Path(self.path), function, *arguments)

    def draw(self, rng: np.random.Generator) -> DrawnScene:
        """Draw a scene; SceneError names the recipe's line that failed."""
        module = _module(self)
        if hasattr(module, "sample"):
            made = self.call(module.sample, rng)
            if not isinstance(made, DrawnScene):
                raise SceneError(
                    f"recipe '{self.name}': sample(rng) returned {type(made).__name__}",
                    "return a sonic_bullet.apps.dataset.DatasetScene",
                )
            return made
        drawn = self.call(module.parameters, rng)
        if not isinstance(drawn, Mapping):
            raise SceneError(f"recipe '{self.name}': parameters(rng) returned {type(drawn).__name__}", "return a dict")
        return DatasetScene(
            lambda client: module.build(client, **drawn),
            drawn,
            str(drawn.get("object", Path(self.path).stem)),
            getattr(module, "SECONDS", DEFAULT_SECONDS),
            getattr(module, "MICROPHONE", DEFAULT_MICROPHONE),
        )


def read_recipe(name: str) -> Recipe:
    """Read the recipe of that name or path and run its top level; SceneError where it is none."""
    ready = {"impacts": Path(__file__).with_name("impacts.py")}  # recipes of the package, by name
    path = ready.get(name, Path(name))
    if not path.is_file():
        near = nearest(name, [*ready, "household"])
        raise SceneError(f"there is no recipe {name}", f"give a Python file, or a ready one: {near}")
    with reading_file(path, "recipe", SceneError, "give a Python file"):
        recipe = Recipe(str(path.resolve()), path.read_text(encoding="utf-8"), name in ready)
    module = _module(recipe)
    if not (hasattr(module, "sample") or (hasattr(module, "parameters") and hasattr(module, "build"))):
        raise SceneError(
            f"recipe '{path.name}' has no function sample(rng)",
            "write one that returns a DatasetScene, or parameters(rng) beside build(client, **parameters)",
        )
    return recipe


@lru_cache(maxsize=2)  # one, and the ready one that warms up
def _module(recipe: Recipe) -> ModuleType:
    """Run a recipe's text as a module, once a process."""
    module = ModuleType(f"sonic_bullet_recipe_{Path(recipe.path).stem}")
    module.__file__ = recipe.path
    recipe.call(partial(_execute, recipe, module))
    return module


def _execute(recipe: Recipe, module: ModuleType) -> None:
    exec(compile(recipe.text, recipe.path, "exec"), module.__dict__)
