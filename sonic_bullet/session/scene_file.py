"""Scene files: their kind, and running their code; an error there is one line that names the place."""

from __future__ import annotations

import ast
import importlib.util
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from sonic_bullet.files.storage.reading import refuse_lfs_pointer
from sonic_bullet.machine.worker import stop_word
from sonic_bullet.records.errors import SceneError, SonicBulletError, exception_words, interrupts


def defines_build(path: Path) -> bool:
    """Tell whether a scene has a function `build` at its top; SceneError where it is not Python."""
    refuse_lfs_pointer(path, SceneError)
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (SyntaxError, ValueError) as error:
        raise SceneError(f"scene '{path.name}' is not Python: {error}", "mend the file") from None
    return any(isinstance(node, ast.FunctionDef) and node.name == "build" for node in tree.body)


def uses_sonic_bullet(path: Path) -> bool:
    """Tell whether a scene imports this package, and so may have a listener of its own."""
    return any(
        (isinstance(node, ast.Import) and any(name.name.split(".")[0] == "sonic_bullet" for name in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sonic_bullet")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    )


def user_code(path: Path, call: Callable[..., Any], *arguments: Any) -> Any:
    """Call the scene's own code; its exceptions become one line that names the line they came from."""
    try:
        with interrupts():
            return call(*arguments)
    except (SonicBulletError, KeyboardInterrupt):
        raise
    except BaseException as error:
        if stop_word():  # an interrupt that became another exception
            raise KeyboardInterrupt(stop_word()) from error
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
        where = f" line {lines[-1]}" if lines else ""
        raise SceneError(f"scene '{path.name}'{where}: {exception_words(error)}", "mend the scene") from error


def scene_module(path: Path) -> ModuleType:
    """Run the file as a module; SceneError names the line where it fails."""
    spec = importlib.util.spec_from_file_location(f"sonic_bullet_scene_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise SceneError(f"'{path}' is not a Python file", "give a scene whose name ends in .py")
    module = importlib.util.module_from_spec(spec)
    user_code(path, _execute, path, module)
    return module


def _execute(path: Path, module: ModuleType) -> None:
    """Run the file as it is now: bytecode beside it counts as its own for a file changed within the same second."""
    exec(compile(path.read_bytes(), str(path), "exec", dont_inherit=True), vars(module))
