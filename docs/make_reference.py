"""The pages of docs/reference that are made of the code: what a docstring, a command's help or a class says is said
once.

python docs/make_reference.py            writes api.md, commands.md, case.schema.json, baked.schema.json, and the marked
                                             parts of case.md, baked.md, contact-log.md, how-a-diagnosis-judges.md
python docs/make_reference.py --check    writes nothing; names what is out of date, and exits with 1 where something is
"""

from __future__ import annotations

import dataclasses
import enum
import importlib
import inspect
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import msgspec

REPO = Path(__file__).resolve().parents[1]
if str(REPO) not in sys.path:
    sys.path.insert(0, str(REPO))

from sonic_bullet.options.option import Options  # noqa: E402 - once the package is found
from sonic_bullet.options.option import describe_options as described_options  # noqa: E402

PLACE = REPO / "docs" / "reference"
MADE = "<!-- Made by `make docs` of the code; change it there. -->"
WIDTH = 100
FIELD = re.compile(
    r"(?<=[.;])\s+(?=[a-z_]\w*\*?(?:(?:, | and )[a-z_]\w*)*(?: \([^)]*\))*[^.:]{0,40}: )"
)  # where a docstring goes on to its next field

API = (
    ("sonic_bullet", "What `import sonic_bullet` offers.", None),
    ("sonic_bullet.simulators.world", "What a simulator implements to be listened to.", ("World",)),
    ("sonic_bullet.records.simulated", "What a simulator says, as a contact log holds it.", ("Body", "Change")),
    (
        "sonic_bullet.apps.compare.comparison_record",
        "What a comparison finds.",
        ("Comparison", "Difference", "Consequence"),
    ),
    ("sonic_bullet.apps.compare.sides", "A scene to be compared.", ("SceneSide",)),
    ("sonic_bullet.apps.bake", "Bake models for other engines, read and play them.", None),
    ("sonic_bullet.environments", "Sound as an observation. It needs the extra `environments`.", None),
    ("sonic_bullet.lab.fit.material_fit", "Fit a material to a case.", ("fit_case",)),
    ("sonic_bullet.files.cases", "Read a case.", ("read_case", "Case", "CaseObject", "CaseRecording", "Line")),
    ("sonic_bullet.files.presets", "Read and write presets.", ("read_preset", "write_preset", "material_of")),
    ("sonic_bullet.lab.diagnosis.diagnose", "Diagnose a case.", ("diagnose", "diagnosis_to_json")),
    ("sonic_bullet.effects", "The effects; what they share is in the next three sections.", ("EFFECTS",)),
    ("sonic_bullet.effects.stages", "What an effect acts on.", "classes"),
    ("sonic_bullet.lab.effects.evidence", "What an effect reads.", "classes"),
    ("sonic_bullet.effects.protocol", "What an effect is.", "classes"),
)


def api_page() -> str:
    """Every public name with its signature and docstring."""
    parts = [
        "# API",
        "",
        MADE,
        "",
        "Errors, units and shapes are those the docstrings name. SI units throughout; `(k, 3)` is an array's shape.",
    ]
    for module_name, what, names in api_names():
        parts += ["", f"## {module_name}", "", what]
        for name, thing in names:
            parts += ["", *entry(name, thing, 3)]
    return "\n".join(parts) + "\n"


def api_names() -> Iterator[tuple[str, str, list[tuple[str, Any]]]]:
    """Yield each section of the API: module, what it is for, its names and what they stand for."""
    for module_name, what, asked in API:
        module = importlib.import_module(module_name)
        names = classes_of(module) if asked == "classes" else asked
        yield module_name, what, [(name, getattr(module, name)) for name in names or module.__all__]


def classes_of(module: ModuleType) -> list[str]:
    """The public classes that a module defines, in its order."""
    own = (
        name for name, thing in vars(module).items() if inspect.isclass(thing) and thing.__module__ == module.__name__
    )
    return [name for name in own if not name.startswith("_")]


def entry(name: str, thing: Any, depth: int) -> Iterator[str]:
    """A name's heading, signature and docstring; of a class also its methods."""
    yield f"{'#' * depth} {name}"
    if inspect.isclass(thing) or inspect.isfunction(thing):
        signature = signature_of(name, thing)
        if signature:
            yield from ["", "```text", *signature, "```"]
    else:
        yield from ["", f"{'a tuple of ' + str(len(thing)) if isinstance(thing, tuple) else type(thing).__name__}."]
        return
    yield from described(thing)
    if inspect.isclass(thing) and issubclass(thing, msgspec.Struct):
        fields = msgspec.json.schema(thing)["$defs"][thing.__name__]["properties"]
        said = [(field, about["description"]) for field, about in fields.items() if "description" in about]
        yield from ["", *(f"- `{field}`: {what}" for field, what in said)] if said else []
    if inspect.isclass(thing) and not issubclass(thing, enum.Enum | BaseException):
        for part, method in vars(thing).items():
            plain = (
                method.__func__
                if isinstance(method, classmethod | staticmethod)
                else method.fget
                if isinstance(method, property)
                else method
            )
            if part.startswith("_") or not inspect.isfunction(plain) or not plain.__doc__:
                continue
            yield ""
            if isinstance(method, property):
                yield f"{'#' * (depth + 1)} {name}.{part} (property)"
                yield from described(plain)
            else:
                yield from entry(f"{name}.{part}", plain, depth + 1)


def described(thing: Any) -> Iterator[str]:
    """A docstring's paragraphs; what it indents is code. A record of options says them itself."""
    text = inspect.getdoc(thing) or ""
    if inspect.isclass(thing) and issubclass(thing, Options):
        text += f"\n\n{described_options(thing)}"
    for paragraph in re.split(r"\n\s*\n", text):
        lines = paragraph.strip("\n").splitlines()
        if not lines:
            continue
        if all(line.startswith("    ") for line in lines):
            yield from ["", "```text", *(line[4:] for line in lines), "```"]
        elif len(lines) > 2 and re.fullmatch("-{3,}", lines[1]):
            yield from ["", f"{lines[0]}:", "", *section_entries(lines[0], lines[2:])]
        else:
            yield ""
            fields = re.split(FIELD, " ".join(line.strip() for line in lines))
            if len(fields) < 2:
                yield from filled(" ".join(fields))
                continue
            for field in fields:
                yield from (f"{'  ' if i else '- '}{line}" for i, line in enumerate(filled(field)))


def section_entries(section: str, lines: list[str]) -> Iterator[str]:
    """Format the entries of a numpydoc section as a list: what is indented below an entry describes it."""
    entries: list[list[str]] = []
    for line in lines:
        if line.startswith("    ") and entries:
            entries[-1].append(line.strip())
        else:
            entries.append([line.strip()])
    for head, *description in entries:
        name, _, kind = head.partition(" : ")
        named = section in ("Parameters", "Other Parameters", "Attributes", "Raises")
        title = f"`{name}` ({kind})" if kind else f"`{head}`" if named else head
        text = f"{title}: {' '.join(description)}" if description else title
        yield from (f"{'  ' if i else '- '}{line}" for i, line in enumerate(filled(text)))


def filled(text: str) -> list[str]:
    """A paragraph in lines of at most 120 columns."""
    lines, line = [], ""
    for word in text.replace("|", "\\|").split():
        if line and len(line) + 1 + len(word) > 120:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
    return [*lines, line]


def signature_of(name: str, thing: Any) -> list[str]:
    """The call, on one line or an argument a line. A protocol has none."""
    if inspect.isclass(thing) and issubclass(thing, BaseException):
        return []
    if inspect.isclass(thing) and issubclass(thing, enum.Enum):
        return [f"{name}: {', '.join(member.value for member in thing)}"]
    if getattr(thing, "_is_protocol", False):
        return []
    if dataclasses.is_dataclass(thing) or inspect.isfunction(thing) or "__init__" in vars(thing):
        source = inspect.signature(thing)
    else:
        return []
    arguments = [argument(p) for p in source.parameters.values() if p.name not in ("self", "cls")]
    starred, seen = [], False
    for p, text in zip(
        [p for p in source.parameters.values() if p.name not in ("self", "cls")], arguments, strict=True
    ):
        if p.kind is p.KEYWORD_ONLY and not seen:
            starred.append("*")
            seen = True
        starred.append(text)
    back = (
        ""
        if inspect.isclass(thing) or source.return_annotation is source.empty
        else f" -> {plain(source.return_annotation)}"
    )
    whole = f"{name}({', '.join(starred)}){back}"
    return [whole] if len(whole) <= WIDTH else [f"{name}(", *(f"    {text}," for text in starred), f"){back}"]


def argument(p: inspect.Parameter) -> str:
    """name: type = default; a default that is built anew reads `…`."""
    text = p.name if p.annotation is p.empty else f"{p.name}: {plain(p.annotation)}"
    if p.default is p.empty:
        return text
    simple = p.default is None or isinstance(p.default, bool | int | float | str | tuple)
    return f"{text} = {p.default!r}" if simple and " object at " not in repr(p.default) else f"{text} = …"


def plain(annotation: Any) -> str:
    """A type as one would write it, without modules."""
    text = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
    return re.sub(r"\b(?:[a-z_0-9]+\.)+(?=[A-Za-z_])", "", text)


def commands_page() -> str:
    """Every command's own help."""
    from sonic_bullet.apps.cli import cli

    parts = [
        "# Commands",
        "",
        MADE,
        "",
        "`sonic-bullet COMMAND --help` says the same. Exit codes: 0 done; 1 sounds differ, or a result is worse than",
    ]
    parts += [
        "silence or missing; 2 one line on stderr says what is wrong; 130 or 143 stopped, with what was",
        "rendered so far closed as a valid file. `--json` alone writes JSON to stdout.",
        "",
        "What is being done stands on stderr. A terminal shows one line of it. Elsewhere there is a line a stage, and",
        "every 4 s at least, such as `[12 s] render drop.py: modes of bowl: …`. `SONIC_BULLET_PROGRESS=0` silences it.",
    ]
    for path, command in walked("sonic-bullet", cli):
        context = click.Context(command, info_name=path, terminal_width=WIDTH, max_content_width=WIDTH)
        text = "\n".join(line.rstrip() for line in command.get_help(context).splitlines())
        parts += ["", f"## {path}", "", "```text", text, "```"]
    return "\n".join(parts) + "\n"


def walked(path: str, command: click.Command) -> Iterator[tuple[str, click.Command]]:
    """A command and all below it."""
    yield path, command
    if isinstance(command, click.Group):
        for name in sorted(command.commands):
            yield from walked(f"{path} {name}", command.commands[name])


def schema_text(schema: dict[str, Any]) -> str:
    """A JSON Schema as its file has it."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def case_fields() -> str:
    """A table a part of case.json."""
    return field_tables(case_schema()["$defs"])


def case_schema() -> dict[str, Any]:
    """The JSON Schema of case.json."""
    from sonic_bullet.files.case_fields import CASE_FORMAT, CaseFile
    from sonic_bullet.files.storage.json_records import record_schema

    return record_schema(CaseFile, CASE_FORMAT)


def baked_fields() -> str:
    """A table a part of a baked model's JSON; its residual is a preset's."""
    parts = baked_schema()["$defs"]
    tables = field_tables({name: part for name, part in parts.items() if name != "ResidualForm"})
    return tables.replace("[ResidualForm](#residualform)", "[residual](preset.md)")


def baked_schema() -> dict[str, Any]:
    """The JSON Schema of a baked model."""
    from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, BakedFile
    from sonic_bullet.files.storage.json_records import record_schema

    return record_schema(BakedFile, BAKED_FORMAT)


def field_tables(defs: dict[str, Any]) -> str:
    """A table a part of a JSON file: field, type, default, meaning."""
    parts = []
    for name, part in defs.items():
        parts += [
            f"### {name}",
            "",
            part.get("description", "").strip(),
            "",
            "| field | type | default | meaning |",
            "|---|---|---|---|",
        ]
        required = part.get("required", ())
        for field, about in part["properties"].items():
            default = (
                "required"
                if field in required
                else f"`{json.dumps(about.get('default'))}`"
                if about.get("default") not in ({}, [])
                else "empty"
            )
            parts.append(f"| `{field}` | {kind_of(about)} | {default} | {about.get('description', '')} |")
        parts.append("")
    return "\n".join(parts).strip()


def log_arrays() -> str:
    """The formats as the file that writes them describes them."""
    lines = (importlib.import_module("sonic_bullet.files.logs").__doc__ or "").splitlines()
    kept = [line[4:] for line in lines if line.startswith("    ")]
    return "\n".join(["```text", *kept, "```"])


def kind_of(about: dict[str, Any]) -> str:
    """A field's JSON type, in words."""
    if "$ref" in about:
        return f"[{(name := about['$ref'].split('/')[-1])}](#{name.lower()})"
    if "enum" in about:
        return " or ".join(f"`{one}`" for one in about["enum"])
    if "anyOf" in about:
        return " or ".join(kind_of(one) for one in about["anyOf"])
    if about.get("type") == "array":
        return (
            f"{len(about['prefixItems'])} numbers" if "prefixItems" in about else f"list of {kind_of(about['items'])}"
        )
    if about.get("type") == "object":
        inner = about.get("additionalProperties")
        return f"object of {kind_of(inner)}" if isinstance(inner, dict) else "object"
    return str(about.get("type", "any"))


def between(page: str, mark: str, text: str) -> str:
    """A page with another text between `<!-- mark -->` and `<!-- end -->`. Raises ValueError where it has no such
    place.
    """
    found, count = re.subn(
        rf"(<!-- {mark} -->\n).*?(<!-- end -->)", lambda m: f"{m[1]}\n{text}\n\n{m[2]}", page, count=1, flags=re.S
    )
    if not count:
        raise ValueError(f"no place <!-- {mark} --> … <!-- end -->")
    return found


def thresholds() -> str:
    """The numbers that decide what a diagnosis accepts."""
    module = importlib.import_module("sonic_bullet.lab.diagnosis.thresholds")
    return str(module.table(module.RULES))


def pages() -> dict[Path, str]:
    """Every made file, and what it should hold."""
    case, log, baked = PLACE / "case.md", PLACE / "contact-log.md", PLACE / "baked.md"
    judges = PLACE.parent / "explanation" / "how-a-diagnosis-judges.md"
    return {
        PLACE / "api.md": api_page(),
        PLACE / "commands.md": commands_page(),
        PLACE / "case.schema.json": schema_text(case_schema()),
        PLACE / "baked.schema.json": schema_text(baked_schema()),
        case: between(case.read_text(encoding="utf-8"), "fields", case_fields()),
        baked: between(baked.read_text(encoding="utf-8"), "fields", baked_fields()),
        log: between(log.read_text(encoding="utf-8"), "arrays", log_arrays()),
        judges: between(judges.read_text(encoding="utf-8"), "thresholds", thresholds()),
    }


def main(arguments: list[str]) -> int:
    """Write or check all; the exit code."""
    old = [path for path, text in pages().items() if not path.is_file() or path.read_text(encoding="utf-8") != text]
    if "--check" in arguments:
        for path in old:
            print(f"{path.relative_to(REPO)} is out of date: make docs", file=sys.stderr)
        return int(bool(old))
    for path in old:
        path.write_text(pages()[path], encoding="utf-8")
        print(path.relative_to(REPO))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
