"""Words: identifiers in the field's own, one meaning a name, packages that one sees at a glance."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "sonic_bullet"
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if "__pycache__" not in path.parts)

PRIVATE_WORDS = frozenset(
    [
        "told",
        "untold",
        "retold",
        "heard",
        "unheard",
        "twin",
        "twins",
        "choked",
        "choke",
        "parted",
        "torn",
        "laid",
        "twos",
        "beside",
        "dried",
        "wet",
        "tails",
        "blow",
        "sounder",
        "suspect",
        "suspects",
        "sure",
        "stilled",
        "riding",
        "rubbing",
        "glided",
        "glide",
        "copies",
        "picked",
        "sift",
        "gathered",
        "way",
    ]
)
"""Words that an identifier has no part of, between underscores or capitals.

Strings are no identifiers: effect ids, and the names in JSON, npz and command lines, stay what files and scripts know.
"""


def parts(name: str) -> set[str]:
    """The words of an identifier: `told_by` and `ToldBy` hold told, `noise_floor` does not hold floors."""
    return {
        word.lower()
        for part in name.split("_")
        for word in re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", part)
    }


def identifiers(tree: ast.AST) -> Iterator[str]:
    """All names that a module gives or uses, those inside f-strings too."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.keyword(arg=str(name)) | ast.ExceptHandler(name=str(name)):
                yield name
            case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)) | ast.MatchMapping(rest=str(name)):
                yield name
            case ast.MatchClass(kwd_attrs=names) | ast.Global(names=names) | ast.Nonlocal(names=names):
                yield from names
            case ast.alias(name=name, asname=given):
                yield from name.split(".")
                yield given or ""
            case ast.ImportFrom(module=str(name)):
                yield from name.split(".")


def bound_names(target: ast.expr) -> Iterator[str]:
    """The names that an assignment's target binds, those of a tuple one by one."""
    match target:
        case ast.Name(id=name):
            yield name
        case ast.Tuple(elts=parts) | ast.List(elts=parts):
            for part in parts:
                yield from bound_names(part)


def constants(tree: ast.Module) -> Iterator[str]:
    """The constants of a module: names in capitals that its top level assigns, dtypes and private ones too."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=targets):
                names = [name for target in targets for name in bound_names(target)]
            case ast.AnnAssign(target=target):
                names = list(bound_names(target))
            case _:
                continue
        yield from (name for name in names if re.fullmatch(r"_*[A-Z][A-Z0-9_]*", name))


def private_words(path: Path) -> set[str]:
    """The identifiers of a file that hold a private word, its own name among them."""
    return {name for name in (*identifiers(ast.parse(path.read_text())), path.stem) if parts(name) & PRIVATE_WORDS}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("told_by", {"told", "by"}),
        ("noise_floor", {"noise", "floor"}),
        ("ToldBy", {"told", "by"}),
        ("_HTMLPage2", {"html", "page"}),
        ("TOLD", {"told"}),
    ],
)
def test_parts_are_what_stands_between_underscores_and_capitals(name: str, words: set[str]) -> None:
    assert parts(name) == words


def test_identifiers_are_seen_wherever_they_stand() -> None:
    source = (
        'import a as told\nfrom b.heard import c\ndef f(wet, *, dried=1):\n    return f"{x.choke:.1f}{twin}"\n'
        "f(beside=2)\nclass Blow: ...\n"
    )
    assert {"told", "heard", "wet", "dried", "choke", "twin", "beside", "Blow"} <= set(identifiers(ast.parse(source)))


def test_identifiers_hold_no_private_word() -> None:
    found = {path.relative_to(PACKAGE).as_posix(): sorted(names) for path in MODULES if (names := private_words(path))}
    print(f"{len(MODULES)} files looked at")
    assert len(MODULES) > 100
    assert found == {}


def test_no_constants_name_stands_in_two_packages() -> None:
    source = "A, (B, _C) = 1, (2, 3)\nD: int = 4\ne = Float = 5\ndef f():\n    G = 6\nclass H:\n    I = 7\n"
    assert list(constants(ast.parse(source))) == ["A", "B", "_C", "D"]
    places = defaultdict(set)
    for path in MODULES:
        for name in constants(ast.parse(path.read_text())):
            places[name].add(path.relative_to(PACKAGE).parts[0])
    assert len(places) > 100
    assert {name: sorted(where) for name, where in places.items() if len(where) > 1} == {}


def test_modules_hold_few_constants() -> None:
    """At most 500 in all: what decides stands beside its only user, or in a record."""
    assert 100 < sum(len(list(constants(ast.parse(path.read_text())))) for path in MODULES) <= 500


def test_no_two_public_classes_have_one_name() -> None:
    places = defaultdict(list)
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(path.relative_to(PACKAGE).as_posix())
    assert len(places) > 100
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_no_file_name_stands_in_two_packages() -> None:
    """An effect's physics and the search for it are two files of one name; a door has the name of what it opens."""
    places = defaultdict(list)
    for path in MODULES:
        name = path.relative_to(PACKAGE).as_posix()
        if path.name != "__init__.py" and not name.startswith(("lab/effects/", "comparing/")):
            places[path.name].append(name)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}
