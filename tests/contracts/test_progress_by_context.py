"""Progress is told by context: a function that works long calls `report_progress` and hands no listener on.

Doors that docs/reference lists take a user's own functions, and set them once.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
from collections.abc import Iterator
from pathlib import Path

REPO = Path(__file__).resolve().parents[2]
PACKAGE = REPO / "sonic_bullet"
LISTENERS = frozenset({"say", "tell", "progress"})
MOST_DOORS = 7


def carriers() -> Iterator[tuple[str, str]]:
    """Yield module and name of each function whose signature carries a listener.

    Compiled kernels have no annotations: there `progress` is where in a step a sample lies.
    """
    for path in PACKAGE.rglob("*.py"):
        module = ".".join(path.relative_to(REPO).with_suffix("").parts).removesuffix(".__init__")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                a = function.args
                named = [one for one in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if one is not None]
                lambda_or_annotated = isinstance(function, ast.Lambda) or any(one.annotation for one in named)
                if lambda_or_annotated and LISTENERS & {one.arg for one in named}:
                    yield module, getattr(function, "name", "lambda")


def public_doors() -> set[tuple[str, str]]:
    """Return module and name of each function and method that docs/reference lists."""
    spec = importlib.util.spec_from_file_location("make_reference", REPO / "docs" / "make_reference.py")
    assert spec is not None and spec.loader is not None
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    listed = [thing for _, _, names in reference.api_names() for _, thing in names]
    methods = [
        inspect.unwrap(method)
        for one in listed
        if inspect.isclass(one)
        for name, method in vars(one).items()
        if inspect.isfunction(method) and not name.startswith("_")
    ]
    functions = [inspect.unwrap(one) for one in listed if inspect.isfunction(one)]
    return {(one.__module__, one.__name__) for one in (*functions, *methods)}


def test_only_public_doors_carry_a_listener() -> None:
    found, doors = sorted(carriers()), public_doors()
    private = [f"{module}.{name}" for module, name in found if (module, name) not in doors]
    said = f"{len(private)} of {len(found)} signatures carry say, tell or progress and are no public door"
    assert not private, f"{said}, where `report_progress` reaches whoever listens: {', '.join(private)}"
    assert 0 < len(found) <= MOST_DOORS, f"{len(found)} public doors carry say, tell or progress"
