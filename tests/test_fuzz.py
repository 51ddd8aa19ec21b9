"""A short run of `benchmarks/fuzz.py`: mutated files of every format end in what they hold or in one short line of
ours.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from benchmarks import fuzz
from benchmarks.fuzzing.doors import Door, doors
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records.errors import SonicBulletError
from tests.few_cases import parametrize_few


def test_every_seed_goes_through_its_door(tmp_path: Path) -> None:
    """Unchanged, each file is read: so that what is refused is refused for its change.

    And each number gives one file, always the same.
    """
    for door in doors():
        path = tmp_path / f"seed{door.suffix}"
        path.write_bytes(door.seed())
        door.enter(path)
        first = [fuzz.mutated(door, 1, number) for number in range(150)]
        assert [fuzz.mutated(door, 1, number) for number in range(150)] == first
        assert len(set(first)) > 100
    assert sum(door.share for door in doors()) == pytest.approx(1)


@parametrize_few("inputs", [200, 1600], 1)
def test_mutated_files_of_every_format_end_in_our_own_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inputs: int
) -> None:
    monkeypatch.setenv("SONIC_BULLET_CACHE", str(tmp_path / "cache"))
    with one_thread():
        fuzz.warm(tmp_path)
        tallies = fuzz.run(inputs, 11, tmp_path)
    assert sum(tally.inputs for tally in tallies.values()) >= inputs
    assert all(tally.inputs for tally in tallies.values())
    assert {name: tally.faults for name, tally in tallies.items() if tally.faults} == {}
    for name, tally in tallies.items():
        assert tally.read + tally.refused == tally.inputs
        assert tally.longest <= fuzz.TEXT_BYTES, name


def test_the_fuzzer_finds_what_it_looks_for(tmp_path: Path) -> None:
    """A reader that crashes, hangs, hoards, throws or rants is a fault each, with the number of its input."""

    class Rant(SonicBulletError):
        def __str__(self) -> str:
            return "x" * 1001

    def wrong(path: Path) -> None:
        number = int(path.stem.rsplit("-", 1)[1])
        if number == 1:
            raise ZeroDivisionError
        if number == 2:
            raise Rant("x")
        if number == 3:
            bytearray(3 << 30)
        if number == 4:
            os._exit(7)  # as a crash in foreign code would

    door = Door("wrong", ".x", 1.0, lambda: b"", lambda draw: bytes([draw.randrange(256)]), wrong)
    tally = fuzz.run(8, 0, tmp_path, chosen=(door,))["wrong"]
    assert (tally.inputs, sorted((number, kind) for kind, number, _ in tally.faults)) == (
        8,
        [(1, "foreign"), (2, "text"), (3, "memory"), (4, "foreign")],
    )
