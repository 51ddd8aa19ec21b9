"""The table of `make bench`: each part makes its rows, and what is not installed is counted. Nothing is timed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from benchmarks import run_time
from benchmarks.peers import PEERS, faust_modal, klank, tools
from tests.few_cases import parametrize_few


def say_measured(rows: list[run_time.Row]) -> None:
    """Every row says what it is and a number, or why there is none."""
    assert rows
    for what, _, said in rows:
        assert what
        assert re.match(r"\d", said) or said.startswith(run_time.NOT_RUN), (what, said)


@parametrize_few("part", run_time.PARTS, (0, 4, 5))
def test_each_part_makes_its_rows(part: str) -> None:
    tiny = {
        "piles": lambda: run_time.piles([2], 4),
        "quiet": lambda: run_time.quiet([2], 4),
        "slide": lambda: run_time.sliding(2, 4),
        "robot": lambda: run_time.robot(4),
        "replay": lambda: run_time.replay("bar", 0.05),
        "bank": lambda: run_time.alone(200, 40_000, 1),
        "peers": lambda: run_time.peers(0.01, 200),
        "first": lambda: run_time.first("bar", 0.05, empty=False),
    }
    say_measured(tiny[part]())


def test_what_must_hold_of_the_issue_stands_in_the_table() -> None:
    named = {peer.name: peer.must_hold for peer in PEERS}
    assert len(named) == 6
    assert named["SuperCollider Klank"] == "bank >= 12 x"


def test_missing_peers_are_rows_that_name_their_package_and_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    rows = run_time.peers(0.01, 200)
    lacking = {what: said for what, _, said in rows if said.startswith(run_time.NOT_RUN)}
    assert lacking["SuperCollider Klank"] == "not run: Debian package supercollider-server"
    assert len(lacking) == 4
    say_measured(rows)
    line = run_time.missing_line(rows)
    assert line.startswith("4 of 6 rows not run: ")
    for package in ("supercollider-server", "csound", "faust", "gcc"):
        assert f"Debian package {package}" in line
    assert run_time.missing_line(rows[3:5]) == "0 of 2 rows not run"


def test_a_peer_that_fails_is_an_error_and_no_missing_one(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="exit 3"):
        tools.run(["sh", "-c", "echo no >&2; exit 3"], tmp_path)


def test_what_peers_are_given_is_whole() -> None:
    """Lengths of the synth definition's score add up, and Faust's program names all modes."""
    score, count = klank.score(1.0), 0
    while score:
        length = int.from_bytes(score[:4], "big")
        assert score[4:12] == b"#bundle\0"
        score, count = score[4 + length :], count + 1
    assert count == 2
    assert faust_modal.program().count(",") == 3 + 3 * (faust_modal.MODES - 1)
