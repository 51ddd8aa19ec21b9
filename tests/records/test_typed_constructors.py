"""What a type checker is told of a record's constructor is what the constructor takes.

Records coerce arrays once they are built, so `if TYPE_CHECKING: def __init__` says ArrayLike where a field is an array.
"""

from __future__ import annotations

import ast
import importlib
import inspect
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]


def typed_constructors() -> list[tuple[str, str, ast.FunctionDef]]:
    """(module, class, __init__) of each class that states one for type checkers alone."""
    found = []
    for path in sorted((REPO / "sonic_bullet").rglob("*.py")):
        module = ".".join(path.relative_to(REPO).with_suffix("").parts)
        text = path.read_text(encoding="utf-8")
        for node in ast.parse(text).body if "TYPE_CHECKING" in text else ():
            if isinstance(node, ast.ClassDef):
                alone = [part for part in node.body if isinstance(part, ast.If) and "TYPE_CHECKING" in ast.dump(part)]
                inits = [one for part in alone for one in part.body if isinstance(one, ast.FunctionDef)]
                found += [(module, node.name, one) for one in inits if one.name == "__init__"]
    return found


@pytest.mark.parametrize(("module", "name", "stated"), typed_constructors(), ids=lambda one: getattr(one, "name", one))
def test_a_stated_constructor_is_the_true_one(module: str, name: str, stated: ast.FunctionDef) -> None:
    true = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    names = [one.arg for one in stated.args.args[1:]]
    defaults = names[len(names) - len(stated.args.defaults) :]
    assert names == list(true)
    assert defaults == [one for one, parameter in true.items() if parameter.default is not parameter.empty]
    for one, value in zip(defaults, stated.args.defaults, strict=True):
        if not (isinstance(value, ast.Constant) and value.value is ...):
            assert ast.literal_eval(value) == true[one].default, one


def test_there_are_some() -> None:
    assert len(typed_constructors()) > 8
