"""Models of the bodies that were added: a surface alone until something touches the body, then its modes.

    BodyRequest -> outline (a `ModalModel` without modes), which the world's record holds
    contacts of a run -> who is touched, the loudest first -> solved_links -> models in place of the outlines

The log of a silent run says who was touched, so that a render solves those alone; whoever reads sound while the world
runs has them solved at their first touch. A log replays to the same bits either way: an outline that nothing touched
adds nothing.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from sonic_bullet.machine.progress import progress_to
from sonic_bullet.records import Air, Array, Body, ModalModel
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import CacheWarning, MeshError, ModalError
from sonic_bullet.session.body_requests import BodyRequest, cache_note, link_request, outline_of, solved_links

Records = Sequence[Body] | Mapping[int, Body]
"""Bodies by their index in the log."""


class _UnsolvedLink(NamedTuple):
    """A link of a request whose model is not solved."""

    request: BodyRequest
    part: int


class UnsolvedModels:
    """Outlines of added bodies and, once they are solved, the models in their place.

    Attributes
    ----------
    notes
        On bodies that have no modes.
    """

    def __init__(self) -> None:
        self.notes: tuple[str, ...] = ()
        self._waiting: WeakKeyDictionary[ModalModel, _UnsolvedLink] = WeakKeyDictionary()
        self._solved: WeakKeyDictionary[ModalModel, ModalModel] = WeakKeyDictionary()
        self._known: WeakKeyDictionary[ModalModel, None] = WeakKeyDictionary()  # models of all bodies, each once

    def __bool__(self) -> bool:
        """Tell whether any body waits for its model."""
        return len(self._waiting) > 0

    def enter(self, wanted: Sequence[BodyRequest]) -> list[list[ModalModel]]:
        """Return the models of each body's links: those given, and outlines.

        Raises MeshError, naming the link.
        """
        made, waiting, surfaces = [], dict[ModalModel, _UnsolvedLink](), dict[str, Any]()
        for one in wanted:
            mine = [one.model] * len(one.parts) if one.model is not None else []
            for part in range(len(one.parts) if one.model is None else 0):
                outline = outline_of(one, part, surfaces)
                if outline.unsolved:
                    waiting[outline] = _UnsolvedLink(one, part)
                mine.append(outline)
            made.append(mine)
        self._waiting.update(waiting)
        self._known.update(dict.fromkeys((model for mine in made for model in mine if not model.unsolved), None))
        return made

    def waits(self, body: Body) -> bool:
        """Tell whether a body's modes are not solved."""
        return body.model in self._waiting if body.model is not None else False

    def waiting_in(self, records: Records) -> Array:
        """Return the indices (w,), ascending, of the bodies whose modes are not solved."""
        pairs = records.items() if isinstance(records, Mapping) else enumerate(records)
        return np.array(sorted(index for index, body in pairs if self.waits(body)), np.int64)

    def solve(self, outlines: Iterable[ModalModel], air: Air | None) -> None:
        """Solve for these models, in this order, and how they radiate into air.

        Raises
        ------
        MeshError, ModalError
            A body cannot be filled or has no usable modes.
        """
        asked = [one for one in dict.fromkeys(outlines) if one in self._waiting]
        if not asked:
            return
        waiting = [self._waiting[one] for one in asked]
        links = [link_request(one.request, one.part) for one in waiting]
        with progress_to(next((one.request.progress for one in waiting if one.request.progress is not None), None)):
            begun_s = time.monotonic()
            models = self._models_of(links, asked, air)
        if note := cache_note(links, time.monotonic() - begun_s):
            warnings.warn(note, CacheWarning, stacklevel=3)
        for outline, model in zip(asked, models, strict=True):
            self._solved[outline] = model
            self._known[model] = None
            del self._waiting[outline]

    def _models_of(
        self, links: Sequence[BodyRequest], outlines: Sequence[ModalModel], air: Air | None
    ) -> list[ModalModel]:
        """Return the models of links; the outline of one that has none and may have none."""
        try:
            return solved_links(links, tuple(self._known), air)
        except (MeshError, ModalError):
            if not any(one.optional for one in links):
                raise
        made: list[ModalModel] = []
        for one, outline in zip(links, outlines, strict=True):
            try:
                (model,) = solved_links([one], (*self._known, *made), air)
            except (MeshError, ModalError) as error:
                if not one.optional:
                    raise
                ((name, _),) = one.parts
                self.notes = (*self.notes, f"{name} clicks but does not ring: {error.what.removeprefix(f'{name}: ')}")
                model = replace(outline, note=f"no modes: {error.what}")
            made.append(model)
        return made

    def solve_outline(self, model: ModalModel) -> ModalModel:
        """Return the model in an outline's place, the model itself where it is none."""
        return self._solved.get(model, model)

    def body(self, record: Body) -> Body:
        """Return a record with its solved model."""
        model = None if record.model is None else self._solved.get(record.model)
        return record if model is None else replace(record, model=model, volume_m3=model.volume_m3)

    def records(self, records: Records) -> Records:
        """Return the records with their solved models, each when it is asked for."""
        return _SolvedRecords(self, records) if self._solved else records


class _SolvedRecords(Mapping[int, Body]):
    """Records by index, with solved models."""

    def __init__(self, models: UnsolvedModels, records: Records) -> None:
        self._models, self._records = models, records

    def __getitem__(self, index: int) -> Body:
        """Return a record."""
        return self._models.body(self._records[index])

    def __iter__(self) -> Iterator[int]:
        """Iterate over the indices."""
        return iter(self._records if isinstance(self._records, Mapping) else range(len(self._records)))

    def __len__(self) -> int:
        """Return the number of records."""
        return len(self._records)


class LinkModels(Sequence[ModalModel]):
    """Models of a body's links, each solved when it is read.

    Parameters
    ----------
    models
        Solved, or outlines.
    solve
        Returns the model in an outline's place.
    """

    def __init__(self, models: Sequence[ModalModel], solve: Callable[[ModalModel], ModalModel]) -> None:
        self._models, self._solve = tuple(models), solve

    def __getitem__(self, index: Any) -> Any:
        """Return a model, or those of a slice."""
        chosen = self._models[index]
        if isinstance(chosen, tuple):
            return tuple(self._solve(one) if one.unsolved else one for one in chosen)
        return self._solve(chosen) if chosen.unsolved else chosen

    def __len__(self) -> int:
        """Return the number of links."""
        return len(self._models)

    def __eq__(self, other: object) -> bool:
        """Compare with a sequence of models; none is solved where they cannot be the same."""
        return (
            isinstance(other, Sequence)
            and len(other) == len(self)
            and all(a is b for a, b in zip(self, other, strict=True))
        )

    __hash__ = None  # type: ignore[assignment]  # what compares by its models is no key

    def __repr__(self) -> str:
        """Say how many there are; solve none."""
        return f"<models of {format_count(len(self), 'link')}>"
