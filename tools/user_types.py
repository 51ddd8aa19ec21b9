"""Check the types of what users write: every script of `examples/`, and the Python of each page as one script.

    python -m tools.user_types [PAGE ...]

A page's blocks stand in one script in their order, each line where the page has it, so that what mypy says of
`build/typed/docs/how-to/diagnose.py:31` is line 31 of `docs/how-to/diagnose.md`. What is checked is the border of the
package as `py.typed` promises it, by `mypy --strict`; libraries without types are none of its errors.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
SCRIPTS = REPO / "build" / "typed"
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```", re.S | re.M)


def script_of(page: str) -> str:
    """Return a page's blocks of Python as one script, each line at its own number; empty where it has none."""
    script, at = "", 0
    for block in BLOCK.finditer(page):
        script += "\n" * page.count("\n", at, block.start(1)) + block[1]
        at = block.end(1)
    return script


def write_scripts(pages: list[Path]) -> list[Path]:
    """Write a script of each page that has Python; return where."""
    shutil.rmtree(SCRIPTS, ignore_errors=True)
    written = []
    for page in pages:
        if script := script_of(page.read_text(encoding="utf-8")):
            name = "_".join(page.relative_to(REPO).with_suffix(".py").parts).replace("-", "_")
            SCRIPTS.mkdir(parents=True, exist_ok=True)
            (SCRIPTS / name).write_text(script, encoding="utf-8")
            written.append(SCRIPTS / name)
    return written


def main() -> int:
    """Do as the module says; return mypy's exit status."""
    asked = [Path(one).resolve() for one in sys.argv[1:]]
    scripts = write_scripts(asked or [REPO / "README.md", *sorted((REPO / "docs").rglob("*.md"))])
    examples = [] if asked else sorted((REPO / "examples").glob("*.py"))
    settings = ["--strict", "--ignore-missing-imports", "--no-error-summary", "--allow-redefinition"]
    settings += ["--cache-dir", str(REPO / "build" / "typed-cache")]  # its options are not the package's own
    command = [sys.executable, "-m", "mypy", *settings, *map(str, scripts + examples)]
    return subprocess.run(command, cwd=REPO, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
