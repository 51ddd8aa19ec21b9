"""The documentation keeps its own rules: short sentences, the field's words, links that lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
PAGES = sorted(
    (
        *(REPO / "docs").rglob("*.md"),
        *(REPO / name for name in ("README.md", "CHANGELOG.md", "benchmarks/README.md", "studies/README.md")),
    )
)
MOST_WORDS, MOST_COLUMNS = 40, 160
PRIVATE = [
    "told",
    "untold",
    "retold",
    "heard",
    "unheard",
    "suspect",
    "suspects",
    "suspected",
    "choke",
    "chokes",
    "choked",
    "choking",
    "twin",
    "twins",
    "blow",
    "blows",
    "sounder",
    "sounders",
    "glide",
    "glides",
    "glided",
    "gliding",
    "hearsay",
    "stilled",
    "dried",
    "rubbing",
]
PHRASES = ("earns its keep", "earned its keep", "earn its keep")
WORDS = re.compile(r"\b(?:" + "|".join([*PRIVATE, *PHRASES]) + r")\b", re.IGNORECASE)


def name_of(page: Path) -> str:
    return page.relative_to(REPO).as_posix()


def outside_code(text: str) -> str:
    """A page without fenced blocks, comments and indented code, its lines kept."""
    text = re.sub(r"^```.*?^```", lambda m: "\n" * m[0].count("\n"), text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", lambda m: "\n" * m[0].count("\n"), text, flags=re.S)
    return re.sub(r"(?m)^(?: {4}|\t)(?![-*|\d]).*$", "", text)


def sentences(text: str) -> Iterator[str]:
    """The sentences of paragraphs, list items and table cells."""
    blocks: list[str] = []
    for line in outside_code(text).splitlines():
        if not line.strip() or line.startswith("#"):
            blocks.append("")
        elif line.lstrip().startswith("|"):
            blocks += ["", *line.strip().strip("|").split("|"), ""]
        elif re.match(r"\s*(?:[-*]|\d+\.)\s", line):
            blocks += ["", line]
        elif blocks:
            blocks[-1] += " " + line.strip()
        else:
            blocks.append(line)
    for block in blocks:
        plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", block)
        plain = re.sub(r"^\s*(?:[-*]|\d+\.)\s+", "", plain)
        yield from (s for s in re.split(r"(?<=[.!?])[\"”*)]*\s+(?=[\"“*(`]*[^\sa-z])", plain) if s.strip())


def test_sentences_are_short() -> None:
    long, count = [], 0
    for page in PAGES:
        for sentence in sentences(page.read_text(encoding="utf-8")):
            count += 1
            words = [word for word in sentence.split() if re.search(r"\w", word)]
            if len(words) > MOST_WORDS:
                long.append(f"{name_of(page)}: {len(words)} words: {' '.join(words[:12])} …")
    assert not long, f"{len(long)} sentences\n" + "\n".join(long)
    assert count > 1000


def test_lines_fit() -> None:
    long = []
    for page in PAGES:
        fenced = False
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            fenced ^= line.startswith("```")
            if len(line) > MOST_COLUMNS and not fenced and not line.startswith(("|", "    ")):
                long.append(f"{name_of(page)}:{number}: {len(line)} columns")
    assert not long, f"{len(long)} lines\n" + "\n".join(long)


def test_words_are_the_fields() -> None:
    """Effect ids, names of JSON and of commands stand in backticks, and may be what they are."""
    found = []
    for page in PAGES:
        text = re.sub(r"`[^`\n]*`", "", outside_code(page.read_text(encoding="utf-8")))
        text = re.sub(r"\]\([^)]*\)", "]", text)
        found += [
            f"{name_of(page)}:{number}: {m[0]}"
            for number, line in enumerate(text.splitlines(), 1)
            for m in WORDS.finditer(line)
        ]
    assert not found, f"{len(found)} words\n" + "\n".join(found)


def test_readme_is_short() -> None:
    lines = (REPO / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) < 120
    first = "\n".join(lines[:45])
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


def test_no_page_is_empty_or_lost() -> None:
    """Every page says something, and the index leads to it."""
    index = (REPO / "docs" / "README.md").read_text(encoding="utf-8") + "".join(
        p.read_text(encoding="utf-8") for p in (REPO / "docs").rglob("README.md") if p.parent != REPO / "docs"
    )
    for page in (REPO / "docs").rglob("*.md"):
        assert len(page.read_text(encoding="utf-8").split()) > 60, name_of(page)
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


def test_changelog_has_its_form() -> None:
    """keepachangelog.com: unreleased first, then versions; entries under a kind of change."""
    heads = re.findall(r"^(##+) (.*)$", (REPO / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert heads[0] == ("##", "[Unreleased]")
    assert all(
        re.fullmatch(r"\[\d+\.\d+\.\d+\](?: - \d{4}-\d\d-\d\d)?", head) for depth, head in heads[1:] if depth == "##"
    )
    kinds = "Added|Changed|Deprecated|Removed|Fixed|Security"
    assert all(re.fullmatch(rf"(?:{kinds})(?:: .+|, .+)?", head) for depth, head in heads if depth == "###")
