"""What pages promise: links lead somewhere, named files, classes and fields exist, made pages are up to date."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
PAGES = sorted(
    (
        *(REPO / "docs").rglob("*.md"),
        *(REPO / "sonic_bullet").rglob("*.md"),
        *(REPO / "src").rglob("*.md"),
        *(
            REPO / f"{name}.md"
            for name in ("README", "CONTRIBUTING", "CHANGELOG", "benchmarks/README", "studies/README")
        ),
    )
)
MOST_COLUMNS = 160  # as ruff's line-length: a format, and none of tables and code


def name_of(page: Path) -> str:
    return page.relative_to(REPO).as_posix()


def test_lines_fit() -> None:
    long = []
    for page in PAGES:
        fenced = False
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            fenced ^= line.startswith("```")
            if len(line) > MOST_COLUMNS and not fenced and not line.startswith(("|", "    ")):
                long.append(f"{name_of(page)}:{number}: {len(line)} columns")
    assert not long, f"{len(long)} lines\n" + "\n".join(long)


def test_readme_begins_with_what_to_run() -> None:
    first = "\n".join((REPO / "README.md").read_text(encoding="utf-8").splitlines()[:45])
    for needed in ("pip install .", "make demo", "make test", "listener.write"):
        assert needed in first, needed


def anchors(page: Path) -> set[str]:
    """The headings' anchors as a forge makes them."""
    heads = re.findall(
        r"(?m)^#+ (.*)$", re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    )
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_links_lead_somewhere() -> None:
    broken, count = [], 0
    for page in PAGES:
        text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"[a-z]+:", target):
                continue
            count += 1
            path, _, anchor = target.partition("#")
            place = (page.parent / path).resolve() if path else page
            if not place.exists() or (anchor and place.suffix == ".md" and anchor not in anchors(place)):
                broken.append(f"{name_of(page)}: {target}")
    assert not broken, "\n".join(broken)
    assert count > 60


NAMED = re.compile(r"`((?:sonic_bullet|tests|benchmarks|studies|scenes|assets|docs|\.ci)/[\w./*-]*)(?:::?\w+)?`")
EXAMPLES = {"my_scene.py", "my_sim.py", "scene.py", "element_tri_p1.py"}
IN_TEXT = re.compile(r"\b(?:benchmarks|studies|tests|docs|scenes|assets)/[\w/-]+\.(?:py|md|json|obj|urdf)\b")


def test_named_files_exist() -> None:
    """In pages, and pages and scripts that code and tests name."""
    gone, count = [], 0
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in {*NAMED.findall(text), *IN_TEXT.findall(text)}:
            count += 1
            if not (list(REPO.glob(name)) if "*" in name else (REPO / name).exists()):
                gone.append(f"{name_of(page)}: {name}")
    for folder in ("sonic_bullet", "benchmarks", "studies", "scenes", "tests"):
        for path in (REPO / folder).rglob("*"):
            if path.suffix not in {".py", ".json"} or path == Path(__file__).resolve():
                continue
            for name in re.findall(r"\bdocs/[\w/-]+\.(?:md|json|py)\b", path.read_text(encoding="utf-8")):
                count += 1
                if not (REPO / name).exists():
                    gone.append(f"{name_of(path)}: {name}")
    tails = {
        path.relative_to(REPO).as_posix()
        for folder in ("sonic_bullet", "benchmarks", "studies", "tests", "scenes", "docs")
        for path in (REPO / folder).rglob("*.py")
    }
    for page in PAGES:
        for name in re.findall(r"`([\w/]+\.py)`", page.read_text(encoding="utf-8")):
            count += 1
            if name not in EXAMPLES and not any(tail == name or tail.endswith("/" + name) for tail in tails):
                gone.append(f"{name_of(page)}: {name}")
    assert not gone, "\n".join(gone)
    assert count > 100


def test_no_page_is_lost() -> None:
    """The index leads to every page."""
    index = (REPO / "docs" / "README.md").read_text(encoding="utf-8") + "".join(
        p.read_text(encoding="utf-8") for p in (REPO / "docs").rglob("README.md") if p.parent != REPO / "docs"
    )
    for page in (REPO / "docs").rglob("*.md"):
        assert page.name in index or page.name == "README.md", name_of(page)


def test_the_install_page_names_every_extra() -> None:
    extras = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    table = re.findall(r"(?m)^\| (`[^|]+) \|", (REPO / "docs" / "start" / "install.md").read_text(encoding="utf-8"))
    named = {name for cell in table for name in re.findall(r"`([a-z]+)`", cell)}
    assert named == set(extras)


def test_every_effect_has_a_page_and_a_picture() -> None:
    from sonic_bullet.effects import EFFECTS

    for effect in EFFECTS:
        text = (REPO / "docs" / "explanation" / "effects" / f"{effect.id}.md").read_text(encoding="utf-8")
        for part in ("## Physics", "## When it is proposed", "## How it looks", "## Limits"):
            assert part in text, (effect.id, part)
        picture = REPO / "docs" / "explanation" / "pictures" / f"{effect.id}.png"
        assert f"../pictures/{effect.id}.png" in text
        assert picture.stat().st_size < 40_000, picture.name


@pytest.mark.parametrize("place", ["reference"])
def test_made_pages_are_up_to_date(place: str) -> None:
    """`make docs` writes them."""
    done = subprocess.run(
        [sys.executable, str(REPO / "docs" / "make_reference.py"), "--check"],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert (REPO / "docs" / place / "api.md").is_file()


def test_names_of_classes_in_pages_exist() -> None:
    """In the page on effects: what a reader is told to derive from is there."""
    from sonic_bullet.effects import protocol

    page = (REPO / "docs" / "how-to" / "add-an-effect.md").read_text(encoding="utf-8")
    table = page[page.index("| class | for an effect that |") : page.index("## Where the file goes")]
    names = re.findall(r"^\| `(\w+)` \|", table, re.M)
    assert len(names) > 4
    assert all(hasattr(protocol, name) for name in names), names


def test_every_field_of_a_preset_is_described() -> None:
    from sonic_bullet.files import presets

    page = (REPO / "docs" / "reference" / "preset.md").read_text(encoding="utf-8")
    fields = [
        *presets.Preset.__struct_fields__,
        *(
            f
            for part in (presets.Elasticity, presets.Damping, presets.Surface, presets.Restitution)
            for f in part.__struct_fields__
        ),
    ]
    assert len(fields) > 20
    assert not [field for field in fields if not re.search(rf"[`.]{field}[`.]", page)]
