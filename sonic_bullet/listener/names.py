"""Names of links: each is one living link's alone, whoever gave it.

    a name given by hand | the simulator's own -> "cube", "cube 2", … in order of appearance
    silent: names whose bearers no sensor hears

A link keeps its name for as long as it lives. A number is never given anew, so that a default name means one thing in
a log; a name given by hand may be given again once its bearer has gone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from sonic_bullet.records.errors import SceneError


def matched(name: str, asked: Collection[str]) -> str | None:
    """Which of the names asked for means a link: its own, else that of the body ("panda") that it ("panda/hand") is of.

    None where none does.
    """
    while name not in asked:
        name, slash, _ = name.rpartition("/")
        if not slash:
            return None
    return name


class Names:
    """State of that for one world. Links are known by their code (frames.encode)."""

    def __init__(self) -> None:
        self._living: dict[int, str] = {}
        self._bearer: dict[str, int] = {}
        self._given: set[str] = set()
        self._count: dict[str, int] = {}
        self.silent: frozenset[str] = frozenset()

    @property
    def codes(self) -> Collection[int]:
        """Those that have a name."""
        return self._living.keys()

    def call(self, code: int, name: str) -> None:
        """Call a link so from now on. Raises SceneError where another living link has that name."""
        if self._bearer.get(name, code) != code:
            raise SceneError(f"the name '{name}' is another body's already", "give each its own")
        self.forget([code])
        self._given.add(name)
        self._living[code], self._bearer[name] = name, code

    def of(self, code: int, default: str) -> str:
        """The link's name; where it has none yet, the default one, with a number where that has been used."""
        if code not in self._living:
            name = self._unused(default)
            self._living[code], self._bearer[name] = name, code
        return self._living[code]

    def called(self, code: int, default: str) -> str:
        """The link's name; where it has none yet, the default one as it is, which is kept for nobody."""
        return self._living.get(code, default)

    def expected(self, links: Sequence[tuple[int, str, str | None]]) -> list[str]:
        """What links of (code, default name, name given by hand) would be called if all were called so now, in turn."""
        trial = Names()
        trial._living, trial._bearer = dict(self._living), dict(self._bearer)
        trial._given, trial._count = set(self._given), dict(self._count)
        for code, _, given in links:
            if given is not None:
                trial.call(code, given)
        return [trial.of(code, default) for code, default, _ in links]

    def forget(self, codes: Iterable[int]) -> None:
        """These links are no more."""
        for code in codes:
            if code in self._living:
                del self._bearer[self._living.pop(code)]

    def hand_over(self, codes: Iterable[int], other: Names) -> None:
        """Call these links in another world of names as they were called by hand; who is silent stays so."""
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
