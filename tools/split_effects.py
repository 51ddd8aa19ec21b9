# mypy: ignore-errors
# ruff: noqa: E501, PLR0912, PLR0915, PLW2901 -- deleted when all branches have followed
"""Divide each effect: its physics stays in the instrument, how it is looked for goes to the laboratory; twice is once.

python tools/split_effects.py            after tools/move_to_wings.py

What an effect needs to be played (`apply`, its numbers, what the instrument imports) stays in sonic_bullet/effects.
The rest goes to the file of the same name in sonic_bullet/lab/effects, `propose` as a function of its own.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from tools.move_to_wings import ROOT, git, in_order, tracked

EFFECTS, LAB = "sonic_bullet.effects", "sonic_bullet.lab.effects"
ALL_PHYSICS = ("", "protocol", "stages", "every_effect", "presets_of_effects", "recorded_lines", "damping_law.damping_form",
               "common.declared_numbers")  # fmt: skip
LAB_METHODS = {"propose", "dereverberated", "identified_from"}
LAB_CLASSMETHODS = {("Orthotropy", "of"): "orthotropy_of"}


@dataclass
class Module:
    """A module of effects: its tree, lines, and the chunks between imports, by the names that each defines."""

    name: str  # below EFFECTS
    path: Path
    text: str
    tree: ast.Module = field(init=False)
    lines: list[str] = field(init=False)
    node: dict[str, ast.stmt] = field(default_factory=dict)
    imported: dict[str, tuple[str, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Read it."""
        self.tree = ast.parse(self.text)
        self.lines = self.text.splitlines(keepends=True)
        for one in self.tree.body:
            for name in defined(one):
                self.node[name] = one
        for one in ast.walk(self.tree):
            if isinstance(one, ast.ImportFrom) and one.module:
                for alias in one.names:
                    self.imported[alias.asname or alias.name] = (one.module, alias.name)


def defined(node: ast.stmt) -> list[str]:
    """Names that a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [x.id for target in targets for x in ast.walk(target) if isinstance(x, ast.Name)]


def read_modules() -> dict[str, Module]:
    """All modules of effects, by their names below EFFECTS."""
    found = {}
    folder = ROOT / EFFECTS.replace(".", "/")
    for path in sorted(folder.rglob("*.py")):
        name = path.relative_to(folder).with_suffix("").as_posix().replace("/", ".")
        name = "" if name == "__init__" else name.removesuffix(".__init__")
        found[name] = Module(name, path, path.read_text(encoding="utf-8"))
    return found


def below(dotted: str) -> str | None:
    """A module's name below EFFECTS; None for others."""
    return "" if dotted == EFFECTS else dotted.removeprefix(f"{EFFECTS}.") if dotted.startswith(f"{EFFECTS}.") else None


def lab_methods(node: ast.ClassDef) -> dict[str, ast.FunctionDef]:
    """Methods of an effect by which it is looked for: those above, and private ones that no other method uses."""
    if not any(isinstance(x, ast.FunctionDef) and x.name == "apply" for x in node.body):
        return {}
    method = {x.name: x for x in node.body if isinstance(x, ast.FunctionDef)}
    found = {name: x for name, x in method.items() if name in LAB_METHODS or (node.name, name) in LAB_CLASSMETHODS}
    while True:
        used = {
            x.attr
            for name, one in method.items()
            if name not in found
            for x in ast.walk(one)
            if isinstance(x, ast.Attribute)
        }
        more = {
            name: x
            for name, x in method.items()
            if name not in found and name.startswith("_") and not name.startswith("__") and name not in used
        }
        if not more or "propose" not in found:
            return found
        found |= more


def uses(node: ast.AST) -> set[str]:
    """Names that a piece of code uses."""
    return {x.id for x in ast.walk(node) if isinstance(x, ast.Name)}


def physics(modules: dict[str, Module]) -> dict[str, set[str]]:
    """Names of each module that the instrument needs."""
    need: dict[str, set[str]] = defaultdict(set)
    work: list[tuple[str, str]] = []

    def want(module: str | None, name: str) -> None:
        if module is None or module == "evidence":
            return
        if f"{module}.{name}".lstrip(".") in modules:
            return
        if module in modules and name not in need[module]:
            need[module].add(name)
            work.append((module, name))

    for name in ALL_PHYSICS:
        for one in modules[name].node:
            want(name, one)
    for name, module in modules.items():
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef) and any(getattr(x, "name", "") == "apply" for x in node.body):
                want(name, node.name)
    for file in tracked():  # what the instrument imports
        if not file.startswith("sonic_bullet/") or not file.endswith(".py"):
            continue
        if file.startswith(("sonic_bullet/lab/", "sonic_bullet/apps/", "sonic_bullet/effects/")):
            continue
        for node in ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    want(below(node.module), alias.name)
    while work:
        module_name, name = work.pop()
        module = modules[module_name]
        node = module.node.get(name)
        if node is None:
            if name in module.imported:
                source, original = module.imported[name]
                want(below(source), original)
            continue
        parts: list[ast.AST] = [node]
        if isinstance(node, ast.ClassDef):
            lab = lab_methods(node)
            parts = [x for x in node.body if getattr(x, "name", "") not in lab]
            parts += [*node.bases, *node.decorator_list]
        for part in parts:
            for inner in ast.walk(part):
                if isinstance(inner, ast.ImportFrom) and inner.module:
                    for alias in inner.names:
                        want(below(inner.module), alias.name)
            for used in uses(part):
                if used in module.node:
                    want(module_name, used)
                elif used in module.imported:
                    source, original = module.imported[used]
                    want(below(source), original)
    return need


def snake(name: str) -> str:
    """`AddedMass` -> added_mass."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def chunks(module: Module) -> list[tuple[ast.stmt | None, str]]:
    """The statements of a module after its imports with the comments above them; texts of strings go with the last."""
    found: list[tuple[ast.stmt | None, str]] = []
    end = 0
    for node in module.tree.body:
        text = "".join(module.lines[end : node.end_lineno])
        end = node.end_lineno or 0
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and found and found[-1][0] is not None:
            found[-1] = (found[-1][0], found[-1][1] + text)
        else:
            found.append((node, text))
    return found


def as_function(module: Module, owner: ast.ClassDef, node: ast.FunctionDef, methods: dict[str, ast.FunctionDef]) -> str:
    """A method as a function of its module."""
    first = min([node.lineno, *(x.lineno for x in node.decorator_list)]) - 1
    text = "".join(line[4:] if line.strip() else line for line in module.lines[first : node.end_lineno])
    is_class = any(isinstance(x, ast.Name) and x.id == "classmethod" for x in node.decorator_list)
    text = re.sub(r"^@classmethod\n", "", text)
    new = function_name(owner, node.name)
    if is_class:
        text = re.sub(rf"^def {node.name}\(\s*cls(, )?\s*", f"def {new}(", text)
    else:
        word = snake(owner.name)
        text = re.sub(rf"^def {node.name}\(\s*self(?=\W)", f"def {new}({word}: {owner.name}", text)
        text = re.sub(r"\bself\b", word, text)
    for name, other in methods.items():
        its = function_name(owner, name)
        if any(isinstance(x, ast.Name) and x.id == "classmethod" for x in other.decorator_list):
            text = re.sub(rf"\bcls\.{name}\(", f"{its}(", text)
        else:
            receiver = rf"\b((?:\w+\.)*\w+(?:\([^()]*(?:\([^()]*\)[^()]*)*\))?)\.{name}\("
            text = re.sub(receiver, lambda m, its=its: m[0] if m[1] in module.imported else f"{its}({m[1]}, ", text)
    text = re.sub(r"\bcls\b", owner.name, text)
    return re.sub(r"\bSelf\b", owner.name, text)


def function_name(owner: ast.ClassDef, method: str) -> str:
    """The function's name that a method becomes."""
    if method == "propose":
        return f"propose_{snake(owner.name)}"
    if method == "dereverberated":
        return f"without_{snake(owner.name)}"
    if method == "identified_from":
        return f"identified_{snake(owner.name)}"
    return LAB_CLASSMETHODS.get((owner.name, method), method)


def divide(
    modules: dict[str, Module], need: dict[str, set[str]]
) -> tuple[dict[str, set[str]], dict[str, str], list[str]]:
    """Write both files of each module. -> names of each module that moved, function of each effect's class, files."""
    gone: dict[str, set[str]] = {}
    functions: dict[str, str] = {}
    written: list[str] = []
    for name, module in modules.items():
        if name in ALL_PHYSICS:
            continue
        keep, lab = [], []
        classes: list[tuple[ast.ClassDef, dict[str, ast.FunctionDef]]] = []
        for node, text in chunks(module):
            names = defined(node) if node is not None else []
            if "__all__" in names or not names or any(one in need[name] for one in names):
                if isinstance(node, ast.ClassDef) and (methods := lab_methods(node)):
                    classes.append((node, methods))
                    cut: set[int] = set()
                    for method in methods.values():
                        first = min([method.lineno, *(x.lineno for x in method.decorator_list)])
                        cut.update(range(first - 1, (method.end_lineno or 0) + 1))
                    begin = (node.end_lineno or 0) - text.count("\n")
                    rows = [module.lines[i] for i in range(begin, node.end_lineno or 0) if i not in cut]
                    text = "".join(rows).rstrip() + "\n"
                keep.append((node, text))
            else:
                lab.append((node, text))
        moved = {one for node, _ in lab if node is not None for one in defined(node)}
        if not moved and not classes:
            continue
        gone[name] = moved
        is_package = module.path.name == "__init__.py"
        place = ROOT / LAB.replace(".", "/") / module.path.relative_to(ROOT / EFFECTS.replace(".", "/"))
        place.parent.mkdir(parents=True, exist_ok=True)
        code = [text for node, text in keep if node is not None and defined(node) and "__all__" not in defined(node)]
        if not code and not is_package:  # all of it
            module.path.rename(place)
            written.append(place.relative_to(ROOT).as_posix())
            continue
        imports = [text for node, text in keep if isinstance(node, ast.Import | ast.ImportFrom | ast.If)]
        doc = ast.get_docstring(module.tree) or ""
        title = doc.splitlines()[0].rstrip(".") if doc else name
        paragraphs = doc.split("\n\n")
        search = [p for p in paragraphs if p.startswith("Identified")]
        rest = [p for p in paragraphs if p not in search]
        head = [f'"""{looked_for(title, name, bool(classes))}\n']
        head += [f"\n{p}\n" for p in search]
        lab_text = "".join(head) + '"""\n' if search else head[0].rstrip("\n") + '"""\n'
        own = sorted(one for one in need[name] if one in module.node)
        if own:
            imports.append(f"from {EFFECTS}.{name} import {', '.join(own)}\n")
        lab_text += "".join(imports)
        # the search is read from its beginning: constants and records, then propose, then what it uses
        constants = [text for node, text in lab if not isinstance(node, ast.FunctionDef)]
        helpers = [text for node, text in lab if isinstance(node, ast.FunctionDef)]
        made = []
        for owner, methods in classes:
            made += [f"\n\n{as_function(module, owner, method, methods)}" for method in methods.values()]
            if "propose" in methods:
                functions[owner.name] = f"{LAB}.{name}:{function_name(owner, 'propose')}"
        lab_text += "".join(constants) + "".join(made) + "".join(helpers)
        place.write_text(lab_text, encoding="utf-8")
        kept_text = "".join(text for _, text in keep)
        if search:
            new_doc = "\n\n".join(rest)
            kept_text = kept_text.replace(doc, new_doc, 1)
        module.path.write_text(kept_text.rstrip() + "\n", encoding="utf-8")
        written += [place.relative_to(ROOT).as_posix(), module.path.relative_to(ROOT).as_posix()]
    for folder in {(ROOT / file).parent for file in written if file.startswith("sonic_bullet/lab/")}:
        while folder != ROOT / LAB.replace(".", "/").rpartition("/")[0]:
            if not (folder / "__init__.py").exists():
                (folder / "__init__.py").write_text("", encoding="utf-8")
                written.append((folder / "__init__.py").relative_to(ROOT).as_posix())
            folder = folder.parent
    return gone, functions, written


def looked_for(title: str, name: str, is_effect: bool) -> str:
    """The first line of a search's docstring."""
    title = title.lstrip("r").strip()
    if is_effect and (m := re.match(r"`([\w-]+)`", title)):
        return f"How `{m[1]}` is looked for."
    return f"What the search needs beside effects/{name.replace('.', '/')}.py."


def reimport(text: str, gone: dict[str, set[str]], modules: set[str]) -> str:
    """Imports of what moved, from where it is."""

    def one(m: re.Match[str]) -> str:
        module = below(m["module"])
        if module is None:
            return m[0]
        inner = m["names"].strip("()")
        if "#" in inner:
            inner = re.sub(r"#[^\n]*", "", inner)
        names = [part.strip() for part in inner.split(",") if part.strip()]
        there: dict[str, list[str]] = {}
        for name in names:
            plain = name.split(" as ")[0]
            home = gone.get(module, set())
            evidence = {"Elastic", "Evidence", "ObjectEvidence", "Poisson"}
            if module in ("protocol", "evidence") and plain in evidence:
                place = f"{LAB}.evidence"
            elif f"{module}.{plain}".lstrip(".") in wholly:
                place = f"{LAB}.{module}".rstrip(".")
            elif plain in home:
                place = f"{LAB}.{module}"
            else:
                place = m["module"]
            there.setdefault(place, []).append(name)
        if list(there) == [m["module"]]:
            return m[0]
        return "\n".join(f"{m['lead']}from {place} import ({', '.join(names)})" for place, names in there.items())

    wholly = {name for name in gone if not (ROOT / EFFECTS.replace(".", "/") / f"{name.replace('.', '/')}.py").exists()
              and not (ROOT / EFFECTS.replace(".", "/") / name.replace(".", "/")).is_dir()}  # fmt: skip
    pattern = re.compile(
        rf"^(?P<lead>[ \t]*)from (?P<module>{re.escape(EFFECTS)}(?:\.\w+)*) import (?P<names>\([^)]*\)|[\w ,]+)", re.M
    )
    text = pattern.sub(one, text)
    for name in wholly:
        text = re.sub(rf"\b{re.escape(EFFECTS)}\.{re.escape(name)}\b", f"{LAB}.{name}", text)
        file = name.replace(".", "/")
        text = re.sub(rf"(?<!lab/)\beffects/{re.escape(file)}\.py\b", f"lab/effects/{file}.py", text)
    return text


def propose_calls(text: str, functions: dict[str, str]) -> str:
    """`Kind.propose(e)` as the function that it became."""
    added = set()

    def one(m: re.Match[str]) -> str:
        place, _, function = functions[m[1]].partition(":")
        added.add(f"from {place} import {function}")
        return f"{function}("

    names = "|".join(map(re.escape, functions))
    text = re.sub(rf"\b(?:\w+\.)?({names})\.propose\(", one, text)
    some = re.sub(r"\b(kind|type\(\w+\))\.propose\(", r"propose(\1, ", text)
    if some != text:
        text = some
        added.add(f"from {LAB}.searches import propose")
    if added:
        text = re.sub(r"^(from __future__ import annotations\n)", r"\1\n" + "\n".join(sorted(added)) + "\n", text, count=1,
                      flags=re.M)  # fmt: skip
    return text


def main() -> int:
    """Divide what is not divided; 0."""
    modules = read_modules()
    if "evidence" not in modules:
        print("divided already")
        return 0
    gone, functions, written = divide(modules, physics(modules))
    git("add", "--intent-to-add", "--", *[name for name in written if (ROOT / name).exists()])
    changed = []
    for name in tracked():
        if not name.endswith((".py", ".md")) or name.startswith("tools/") or name == "CHANGELOG.md":
            continue
        path = ROOT / name
        text = path.read_text(encoding="utf-8")
        new = text if name == "docs/how-to/add-an-effect.md" else reimport(text, gone, set(modules))
        if name.endswith(".py") and not name.startswith("sonic_bullet/effects/"):
            new = propose_calls(new, functions)
        if new != text:
            path.write_text(new, encoding="utf-8")
            changed.append(name)
    python = [name for name in {*changed, *written} if name.endswith(".py") and (ROOT / name).exists()]
    ruff = ["ruff", "check", "--quiet", "--fix", "--select", "F401,I"]
    for name in python:
        if name.endswith("__init__.py") and name in written:  # in which ruff takes imports for exports
            text, shown = (ROOT / name).read_text(encoding="utf-8"), name.replace("__init__", "package")
            done = subprocess.run(
                [*ruff, "--stdin-filename", shown, "-"],
                cwd=ROOT,
                check=False,
                input=text,
                capture_output=True,
                text=True,
            )
            (ROOT / name).write_text(done.stdout, encoding="utf-8")
    subprocess.run([*ruff, *python], cwd=ROOT, check=False)
    in_order(python)
    git("add", "-A", "sonic_bullet", "tests", "docs", "studies", "benchmarks")
    for owner, place in functions.items():
        print(owner, place)
    return 0


if __name__ == "__main__":
    sys.exit(main())
