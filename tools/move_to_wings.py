"""Move packages into three wings, on any branch: files, names in code and text, then imports in order.

python tools/move_to_wings.py            moves what lies at an old place and rewrites what names it; twice is once

A package that moves takes along what is new in it. Doors (DOORS) keep old names on purpose and are left alone.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "sonic_bullet"

MODULES = {
    # instrument
    "bank": "engine.bank",
    "contact": "engine.contact",
    "path": "engine.path",
    "runtime": "engine.runtime",
    "residual": "engine.residual",
    "residual.code": "files.residual_code",
    "soundtrack.sound_events": "engine.runtime.sound_events",
    "soundtrack.own_sound": "engine.runtime.own_sound",
    "listener": "simulators",
    "live": "session.live",
    "storage": "files.storage",
    "storage.leftovers": "machine.leftovers",
    "presets": "files.presets",
    "materials": "files.materials",
    "parallel": "machine.parallel",
    "estimator.perceptual": "signal.perceptual",
    # laboratory
    "residual.compute": "lab.residual.compute",
    "estimator": "lab",
    "estimator.hammer_pulse": "lab.lines.hammer_pulse",
    "diagnosis": "lab.diagnosis",
    "states": "lab.states",
    # uses
    "comparing": "apps.compare",
    "report.compare_page": "apps.compare.compare_page",
    "soundtrack": "apps.soundtrack",
    "dataset": "apps.dataset",
    "environments": "apps.environments",
    "bake": "apps.bake",
    "jobs": "apps.jobs",
    "report": "apps.report",
    "plots": "apps.report.plots",
    "cli": "apps.cli",
}
"""Old name below the package -> new one; a folder's files follow it, unless they stand here themselves."""

LINES_TESTS = (  # of the estimator's
    "after_attack", "features", "features_bad", "pole_selection", "response_lines", "same_bytes", "strike_times",
)  # fmt: skip
TESTS = {
    "bank": "engine.bank",
    "contact": "engine.contact",
    "path": "engine.path",
    "runtime": "engine.runtime",
    "residual": "engine.residual",
    "residual.test_residual_recordings": "lab.residual.test_residual_recordings",
    "engine.test_elementary": "engine.compiled.test_elementary",
    "engine.test_fuzzed_steps": "engine.compiled.test_fuzzed_steps",
    "engine.test_installed": "engine.compiled.test_installed",
    "listener": "simulators",
    "live": "session.live",
    "storage": "files.storage",
    "test_presets": "files.test_presets",
    "test_parallel": "machine.test_parallel",
    "estimator": "lab.fit",
    **{f"estimator.test_{name}": f"lab.lines.test_{name}" for name in LINES_TESTS},
    "estimator.test_metric": "signal.test_metric",
    "diagnosis": "lab.diagnosis",
    "effects": "lab.effects",
    "states": "lab.states",
    "comparing": "apps.compare",
    "soundtrack": "apps.soundtrack",
    "environments": "apps.environments",
    "bake": "apps.bake",
    "plots": "apps.report",
    "cli": "apps.cli",
}
"""The same of tests."""

OTHER_FILES = {"sonic_bullet/report/compare_page.html.jinja": "sonic_bullet/apps/compare/compare_page.html.jinja"}

NEW_PACKAGES = {
    "sonic_bullet/engine": "contact -> bank -> path: forces, modes in motion, pressure; the run time that drives them.",
    "sonic_bullet/lab": "",
    "sonic_bullet/lab/residual": "",
    "sonic_bullet/apps": "Uses of the instrument and the laboratory: none knows another but the command line.",
    "tests/engine": "",
    "tests/engine/compiled": "",
    "tests/lab": "",
    "tests/lab/lines": "",
    "tests/lab/residual": "",
    "tests/apps": "",
}
"""Folders that become packages, with the docstring of those that had none."""

DOORS = {
    "sonic_bullet/environments.py",
    "sonic_bullet/comparing/__init__.py",
    "sonic_bullet/comparing/pytest_plugin.py",
    "tests/contracts/test_doors.py",
}
NOT_REWRITTEN = DOORS | {"CHANGELOG.md", "tools/move_to_wings.py"}
KEPT_NAMES = {"environments", "comparing"}
"""Names that users have: left as they are in pages and examples, unless a module of theirs is named."""

ENDINGS = {".py", ".pyi", ".md", ".toml", ".yml", ".yaml", ".jinja", ".txt", ".cpp", ".hpp", ".cfg", ".sh", ""}
NOT_READ = ("sonic_bullet/materials/", "sonic_bullet/files/materials/", "assets/", "tests/data/")


def git(*words: str) -> str:
    """What a command of git writes."""
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def tracked() -> list[str]:
    """Files of the tree, relative to its root."""
    return [name for name in git("ls-files", "-z").split("\0") if name and (ROOT / name).is_file()]


def renamed(dotted: str, rules: dict[str, str]) -> str:
    """A dotted name after the move: by the longest rule that it begins with."""
    parts = dotted.split(".")
    for n in range(len(parts), 0, -1):
        if (new := rules.get(".".join(parts[:n]))) is not None:
            return ".".join([new, *parts[n:]])
    return dotted


def new_place(name: str) -> str:
    """A file's place after the move."""
    if name in OTHER_FILES:
        return OTHER_FILES[name]
    for folder, rules in ((PACKAGE, MODULES), ("tests", TESTS)):
        if name.startswith(f"{folder}/"):
            inner = name.removeprefix(f"{folder}/")
            stem, dot, ending = inner.rpartition(".py") if inner.endswith(".py") else (inner, "", "")
            *folders, last = stem.split("/")
            if dot and not ending:
                return f"{folder}/{renamed('.'.join([*folders, last]), rules).replace('.', '/')}.py"
            if folders:
                return f"{folder}/{renamed('.'.join(folders), rules).replace('.', '/')}/{last}"
    return name


def move(files: Iterable[str]) -> dict[str, str]:
    """Move files; where each went."""
    moved, made = {}, []
    for old in files:
        new = new_place(old)
        if new == old or (old in DOORS and (ROOT / new).exists()):
            continue
        if (ROOT / new).exists():
            if old.endswith("__init__.py") and not (ROOT / old).read_text(encoding="utf-8").strip():
                (ROOT / old).unlink()
                continue
            raise SystemExit(f"{old}: {new} is there already")
        (ROOT / new).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / old).rename(ROOT / new)
        moved[old] = new
    for folder in {(ROOT / name).parent for name in moved}:  # leftovers such as compiled modules
        if folder.is_dir() and not any(p.is_file() and "__pycache__" not in p.parts for p in folder.rglob("*")):
            shutil.rmtree(folder)
    for package, said in NEW_PACKAGES.items():
        place = ROOT / package / "__init__.py"
        if not place.exists() and place.parent.is_dir():
            place.write_text(f'"""{said}"""\n' if said else "", encoding="utf-8")
            made.append(f"{package}/__init__.py")
    git("add", "--intent-to-add", *made, *moved.values())
    return moved


def deeper(text: str, steps: int) -> str:
    """A moved file's text with `Path(__file__)….parents[n]` as many folders further up."""
    return re.sub(
        r"(Path\(__file__\)(?:\.resolve\(\))?\.parents\[)(\d+)\]", lambda m: f"{m[1]}{int(m[2]) + steps}]", text
    )


def rewrite_from_imports(text: str, is_page: bool) -> str:
    """`from sonic_bullet.a import b, c`, where b may be a module that goes elsewhere than its package."""
    pattern = re.compile(
        rf"^(?P<lead>[ \t>.|]*)from (?P<root>{PACKAGE}|tests)(?P<below>(?:\.\w+)*) import (?P<names>\([^)]*\)|[\w ,]+)",
        re.MULTILINE,
    )

    def one(m: re.Match[str]) -> str:
        rules = MODULES if m["root"] == PACKAGE else TESTS
        package = m["below"].lstrip(".")
        inner = re.sub(r"#[^\n]*", "", m["names"].strip("()")) if "#" in m["names"] else m["names"].strip("()")
        names = [part.strip() for part in inner.split(",") if part.strip()]
        groups: dict[str, list[str]] = {}
        special = False
        for name in names:
            plain, _, alias = name.partition(" as ")
            full = f"{package}.{plain}" if package else plain
            if full in rules and not (is_page and full in KEPT_NAMES):
                place, _, last = rules[full].rpartition(".")
                named = last if last == (alias or plain) else f"{last} as {alias or plain}"
                special = True
            else:
                place = renamed(package, rules) if package and not (is_page and package in KEPT_NAMES) else package
                named = name
            groups.setdefault(place, []).append(named)
        if not special:  # the dotted name is rewritten with all others
            return m[0]
        made = []
        for place, group in groups.items():
            head = f"{m['lead']}from {m['root']}{'.' if place else ''}{place} import "
            line = head + ", ".join(group)
            if len(line) > 120:
                line = head + "(" + ", ".join(group) + ")"
            made.append(line)
        return "\n".join(made)

    return pattern.sub(one, text)


def rewrite(text: str, name: str, old_modules: set[str]) -> str:
    """A file's text with new names."""
    is_page = name.endswith(".md") or name.startswith("examples/")

    def dotted(m: re.Match[str]) -> str:
        rules = MODULES if m[1] == PACKAGE else TESTS
        if is_page and m[2].split(".")[0] in KEPT_NAMES:
            package, _, below = m[2].partition(".")
            if f"{package}.{below.split('.')[0]}" not in old_modules:
                return m[0]
        return f"{m[1]}.{renamed(m[2], rules)}"

    def path(m: re.Match[str]) -> str:
        rules = MODULES if m[1] == PACKAGE else TESTS
        if m[0] in OTHER_FILES:
            return OTHER_FILES[m[0]]
        stem = m[2].removesuffix(".py")
        trailing = "/" if stem.endswith("/") else ""
        *parts, last = stem.rstrip("/").split("/")
        inner, dot, ending = last.partition(".")
        new = renamed(".".join([*parts, inner]), rules).replace(".", "/")
        return f"{m[1]}/{new}{dot}{ending}{trailing}{'.py' if m[2].endswith('.py') else ''}"

    def short_path(m: re.Match[str]) -> str:
        stem = m[1].removesuffix(".py").replace("/", ".")
        if stem not in old_modules:
            return m[0]
        return renamed(stem, MODULES).replace(".", "/") + ".py"

    def short_dotted(m: re.Match[str]) -> str:
        parts = m[1].split(".")
        if ".".join(parts[:2]) not in old_modules:
            return m[0]
        return f"`{renamed(m[1], MODULES)}`"

    def anchor(m: re.Match[str]) -> str:
        return f"#{PACKAGE}{anchors.get(m[1], m[1])}"

    anchors = {module.replace(".", ""): renamed(module, MODULES).replace(".", "") for module in old_modules}
    text = rewrite_from_imports(text, is_page)
    text = re.sub(rf"(?<![\w/.])({PACKAGE}|tests)\.((?:[a-z_]\w*\.)*\w+)", dotted, text)
    text = re.sub(rf"(?<![\w-])({PACKAGE}|tests)/((?:[\w-]+/)*[\w-]+(?:\.\w+)*/?)", path, text)
    text = re.sub(r"(?<![\w/.-])((?:[a-z_0-9]+/)+[a-z_0-9]+\.py)\b", short_path, text)
    text = re.sub(r"`([a-z_]\w*(?:\.\w+)+)`", short_dotted, text)
    text = re.sub(rf"#{PACKAGE}([a-z_]+)\b", anchor, text)
    if name == f"{PACKAGE}/__init__.py":  # the table of homes
        text = re.sub(
            r'(": ")([a-z_.]+)(",)',
            lambda m: m[1] + renamed(m[2], MODULES) + m[3],
            text,
        )
    return text


def in_order(files: list[str]) -> None:
    """Sort imports and format what was rewritten."""
    python = [name for name in files if name.endswith((".py", ".pyi")) and (ROOT / name).exists()]
    if not python:
        return
    ruff = shutil.which("ruff", path=str(Path(sys.executable).parent)) or shutil.which("ruff")
    if ruff is None:
        raise SystemExit("ruff is neither beside this Python nor on PATH")
    run: Callable[..., subprocess.CompletedProcess[str]] = subprocess.run
    run([ruff, "check", "--quiet", "--fix", "--select", "I", *python], cwd=ROOT, check=False)
    run([ruff, "format", "--quiet", *python], cwd=ROOT, check=False)


def main() -> int:
    """Move, rewrite, put in order; 0."""
    before = tracked()
    old_modules = {
        part.removesuffix("/__init__")
        for name in before
        if name.startswith(f"{PACKAGE}/") and name.endswith(".py") and new_place(name) != name and name not in DOORS
        for part in [name.removeprefix(f"{PACKAGE}/").removesuffix(".py")]
    }
    old_modules = {name.replace("/", ".") for name in old_modules}
    moved = move(before)
    for old, new in moved.items():
        if (steps := new.count("/") - old.count("/")) and new.endswith(".py"):
            place = ROOT / new
            place.write_text(deeper(place.read_text(encoding="utf-8"), steps), encoding="utf-8")
    changed = []
    for name in tracked():
        if name in NOT_REWRITTEN or name.startswith(NOT_READ) or Path(name).suffix not in ENDINGS:
            continue
        place = ROOT / name
        try:
            text = place.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        new_text = rewrite(text, name, old_modules)
        if new_text != text:
            place.write_text(new_text, encoding="utf-8")
            changed.append(name)
    in_order(changed + [new for new in moved.values() if new not in changed])
    git("add", "-u")
    print(f"{len(moved)} files moved, {len(changed)} rewritten")
    return 0


if __name__ == "__main__":
    sys.exit(main())
