"""Names of links, each unique among the living links.

    a name given by hand | the simulator's own -> "cube", "cube 2", … in order of appearance
    silent: names whose links no sensor receives

A link keeps its name for as long as it lives. A number is never reused, so that a default name means one link in a
log; a name given by hand may be given again once its link has gone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from sonic_bullet.records.errors import SceneError


def match_name(name: str, asked: Collection[str]) -> str | None:
    """Find which of the names asked for means a link: its own, else its body's ("panda" of "panda/hand"); or None."""
    while name not in asked:
        name, slash, _ = name.rpartition("/")
        if not slash:
            return None
    return name


class Names:
    """Names of the links of one world, by their code (frames.encode)."""

    def __init__(self) -> None:
        self._living: dict[int, str] = {}
        self._bearer: dict[str, int] = {}
        self._given: set[str] = set()
        self._count: dict[str, int] = {}
        self.silent: frozenset[str] = frozenset()

    @property
    def codes(self) -> Collection[int]:
        """Codes of the links that have a name."""
        return self._living.keys()

    def call(self, code: int, name: str) -> None:
        """Give a link a name.

        Raises
        ------
        SceneError
            Another living link has it.
        """
        if self._bearer.get(name, code) != code:
            raise SceneError(f"the name '{name}' is another body's already", "give each its own")
        self.forget([code])
        self._given.add(name)
        self._living[code], self._bearer[name] = name, code

    def of(self, code: int, default: str) -> str:
        """Return the link's name; where it has none, assign the default one, with a number where that has been used."""
        if code not in self._living:
            name = self._unused(default)
            self._living[code], self._bearer[name] = name, code
        return self._living[code]

    def name_link(self, code: int, default: str) -> str:
        """Return the link's name; where it has none, the default one, which is not assigned."""
        return self._living.get(code, default)

    def predict_names(self, links: Sequence[tuple[int, str, str | None]]) -> list[str]:
        """Predict the names of links (code, default name, name given by hand) if all were named now, in turn."""
        trial = Names()
        trial._living, trial._bearer = dict(self._living), dict(self._bearer)
        trial._given, trial._count = set(self._given), dict(self._count)
        for code, _, given in links:
            if given is not None:
                trial.call(code, given)
        return [trial.of(code, default) for code, default, _ in links]

    def forget(self, codes: Iterable[int]) -> None:
        """Remove these links."""
        for code in codes:
            if code in self._living:
                del self._bearer[self._living.pop(code)]

    def hand_over(self, codes: Iterable[int], other: Names) -> None:
        """Copy the names given by hand of these links to another `Names`, and the silent names."""
        other.silent = self.silent
        for code in codes:
            if self._living.get(code) in self._given:
                other.call(code, self._living[code])

    def _unused(self, default: str) -> str:
        while True:
            self._count[default] = count = self._count.get(default, 0) + 1
            name = default if count == 1 else f"{default} {'#' if default[-1:].isdigit() else ''}{count}"
            if name not in self._given and name not in self._bearer:
                return name
