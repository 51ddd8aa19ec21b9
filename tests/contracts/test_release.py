"""A release says one version everywhere, and its entry in the changelog is dated."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import sonic_bullet

REPO = Path(__file__).resolve().parents[2]


def test_one_version_stands_everywhere() -> None:
    project = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    entries = re.findall(r"(?m)^## \[(\d.*?)\] - \d{4}-\d\d-\d\d$", (REPO / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert entries, "no version of CHANGELOG.md has a date"
    assert entries[0] == project["version"] == sonic_bullet.__version__


def test_the_changelog_has_its_form() -> None:
    """keepachangelog.com: unreleased first, then versions with a date, newest first; entries under a kind of change."""
    heads = re.findall(r"^(##+) (.*)$", (REPO / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert heads[0] == ("##", "[Unreleased]")
    dates = [re.fullmatch(r"\[\d+\.\d+\.\d+\] - (\d{4}-\d\d-\d\d)", head) for depth, head in heads[1:] if depth == "##"]
    assert dates and all(dates)
    found = [date[1] for date in dates if date]
    assert found == sorted(found, reverse=True)
    kinds = "Added|Changed|Deprecated|Removed|Fixed|Security"
    assert all(re.fullmatch(rf"(?:{kinds})(?:: .+|, .+)?", head) for depth, head in heads if depth == "###")
