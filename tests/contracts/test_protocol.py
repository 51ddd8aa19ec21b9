"""Nobody asks an effect who it is: no probing for attributes, no id of an effect outside its own file or folder."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

from sonic_bullet.effects import EFFECTS

PACKAGE = Path(__file__).resolve().parents[2] / "sonic_bullet"
PACKAGES = ("effects", "lab/diagnosis", "lab/effects", "lab/fit", "lab/lines", "lab/residual")
PROBES = frozenset({"hasattr", "getattr", "attrgetter", "runtime_checkable"})
IDS = frozenset(kind.id for kind in EFFECTS)

OTHER_MEANINGS = {"effects/protocol.py": {"room"}}
"""Words that are an effect's id elsewhere: `Owner.ROOM` is what an effect belongs to."""


def trees() -> Iterator[tuple[str, ast.AST]]:
    """Every file of these packages, by its path in the package."""
    for name in PACKAGES:
        for path in sorted((PACKAGE / name).rglob("*.py")):
            yield path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def probes(tree: ast.AST) -> list[int]:
    """Lines that ask for an attribute by its name, or for a protocol at run time."""
    names = (
        (node, node.id if isinstance(node, ast.Name) else node.attr)
        for node in ast.walk(tree)
        if isinstance(node, ast.Name | ast.Attribute)
    )
    called = [node.lineno for node, name in names if name in PROBES]
    return called + [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and PROBES & {one.name for one in node.names}
    ]


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Strings that a module works with, f-strings and patterns among them, and where they stand."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


def homes() -> dict[str, str]:
    """The file, or the folder, that each effect's id is at home in."""
    found = {}
    for kind in EFFECTS:
        path = Path(inspect.getfile(kind))
        found[kind.id] = (path.parent if path.name == "__init__.py" else path).relative_to(PACKAGE).as_posix()
    return found


@pytest.mark.parametrize(
    "source",
    [
        "hasattr(x, 'a')",
        "y = getattr(x, 'a', None)",
        "operator.attrgetter('a')",
        "from typing import runtime_checkable",
        "@runtime_checkable\nclass A: ...",
    ],
)
def test_probes_are_seen(source: str) -> None:
    assert probes(ast.parse(source))


def test_nothing_is_probed_for() -> None:
    looked_at, found = 0, []
    for name, tree in trees():
        looked_at += 1
        found += [f"{name}:{line}" for line in probes(tree)]
    print(f"{looked_at} files looked at")
    assert looked_at > 100
    assert found == []


def test_an_effects_id_stands_in_its_own_file_alone() -> None:
    home, count, own, found = homes(), 0, set(), []
    for name, tree in trees():
        for line, text in texts(tree):
            count += 1
            if text not in IDS or text in OTHER_MEANINGS.get(name, set()):
                continue
            if name == home[text] or name.startswith(home[text] + "/"):
                own.add(text)
            else:
                found.append(f"{name}:{line}: {text}")
    print(f"{count} strings looked at, {len(IDS)} ids")
    assert count > 1000
    assert own == IDS, "every id is seen where it is at home"
    assert found == []


def test_no_optional_word_is_a_runtime_protocol() -> None:
    """What an effect may do beside is a base class, which a type checker sees."""
    from sonic_bullet.effects import protocol

    optional = [
        thing
        for _, thing in inspect.getmembers(protocol, inspect.isclass)
        if inspect.isabstract(thing) and thing.__module__ == protocol.__name__
    ]
    assert len(optional) >= 5
    for thing in optional:
        assert not vars(thing).get("_is_runtime_protocol", False), thing.__name__
