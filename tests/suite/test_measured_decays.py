"""How long real things ring: what is left after the attack decides, each body counts once, and the page says so."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.made_presets import MEASURED, chosen, fitted, made_preset
from benchmarks.measured_decays import MeasuredDecay, by_octave, octave_of, read_table, write_table
from benchmarks.preset_decays import FACTOR, PAGE, medians, page, ratios, rows_of, t60_s
from sonic_bullet.files.presets import load_material, named_preset

REPO = Path(__file__).resolve().parents[2]


def _row(body: str, t60: float, octave: int = 1000, material: str = "glass", kind: str = "body") -> MeasuredDecay:
    return MeasuredDecay(body, material, kind, "set", octave, 1, t60)


def test_octaves_meet_without_a_gap() -> None:
    assert [octave_of(f) for f in (176.0, 177.0, 353.0, 354.0, 1000.0, 11_313.0, 11_314.0)] == [
        None, 250, 250, 500, 1000, 8000, None,
    ]  # fmt: skip


def test_lines_of_the_attack_decide_nothing() -> None:
    mode = (1100.0, 0.5, 0.1)
    attack = [(900.0 + 20 * k, 0.006, 1.0) for k in range(20)]
    assert by_octave([mode])[1000] == (0.5, 1)
    assert by_octave([*attack, mode])[1000][0] == 0.5
    hum = (1000.0, 90.0, 1e-4)  # of which a long decay makes much energy
    assert by_octave([mode, hum])[1000] == (0.5, 1)
    assert by_octave([]) == {}


def test_a_median_counts_each_body_once_and_no_class() -> None:
    rows = [_row("a", 1.0), _row("b", 2.0), _row("c", 9.0), _row("class", 0.01, kind="class"), _row("d", 4.0, 2000)]
    mine = rows_of("glass", rows)
    assert medians(mine) == {1000: (2.0, 3), 2000: (4.0, 1)}
    glass = load_material("glass")
    assert ratios(glass, mine) == {1000: pytest.approx(t60_s(glass)[1000] / 2.0)}, "two octaves, one with three bodies"


def test_iron_and_steel_count_as_metal() -> None:
    rows = [_row("bar", 1.0, material="steel"), _row("pan", 2.0, material="iron"), _row("cup", 3.0)]
    assert [r.body for r in rows_of("metal", rows)] == ["bar", "pan"]
    assert [r.body for r in rows_of("steel", rows)] == ["bar"]


def test_rayleigh_s_law_is_what_the_page_shows() -> None:
    glass = load_material("glass")
    w = 2 * np.pi * 4000
    assert t60_s(glass)[4000] == pytest.approx(np.log(1000) / (0.5 * (18.301 + 1.4342e-7 * w**2)))


def test_the_page_is_that_of_the_table(tmp_path: Path) -> None:
    rows = read_table(REPO / "docs" / "measured" / "decays.csv")
    write_table(tmp_path / "again.csv", rows)
    assert read_table(tmp_path / "again.csv") == rows
    assert len({r.body for r in rows if r.kind == "body"}) >= 30
    assert len({(r.body, r.octave_hz) for r in rows}) == len(rows)
    assert page(rows) == (REPO / PAGE).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", MEASURED)
def test_things_as_made_ring_within_a_factor_of_two_of_the_median(name: str) -> None:
    rows = read_table(REPO / "docs" / "measured" / "decays.csv")
    found = ratios(load_material(f"made-{name}"), rows_of(MEASURED[name], rows))
    assert all(1 / FACTOR <= ratio <= FACTOR for ratio in found.values()), found
    judged = {"porcelain": 3, "wood": 4, "steel": 3, "metal": 4, "spruce": 2}
    assert len(found) >= judged.get(name, 0)


@pytest.mark.parametrize("name", ["porcelain", "metal"])
def test_the_presets_are_what_the_table_gives(name: str) -> None:
    rows = read_table(REPO / "docs" / "measured" / "decays.csv")
    assert made_preset(name, rows) == named_preset(f"made-{name}")


def test_a_law_has_no_more_numbers_than_the_medians_ask_for() -> None:
    loss = [_row(body, 2.2 / (2e-3 * f / 1000) / 1000, f) for f in (500, 1000, 4000) for body in "abc"]
    assert len(chosen(loss)) == 1
    steep = [_row(body, 2.0 * (f / 1000) ** -1.8, f) for f in (500, 1000, 4000, 8000) for body in "abc"]
    assert chosen(steep)[1] == pytest.approx(1.8, abs=1e-3)
    level = [_row(r.body, r.t60_s + 0.2, r.octave_hz) for r in steep]
    assert np.exp(fitted(level, 3)[2]) == pytest.approx(0.2, rel=0.05)


@pytest.mark.shared
def test_a_body_is_measured_by_the_command(shared_path: Path, tmp_path: Path) -> None:
    data, table = shared_path / "measured", tmp_path / "table.csv"
    words = [sys.executable, "-m", "benchmarks.measured_decays", "--data", str(data), "--out", str(table)]
    subprocess.run([*words, "iron mortar", "spruce plate 1L"], check=True, capture_output=True, cwd=REPO, timeout=250)
    kept = {(r.body, r.octave_hz): r.t60_s for r in read_table(REPO / "docs" / "measured" / "decays.csv")}
    found = read_table(table)
    assert {r.body for r in found} == {"iron mortar", "spruce plate 1L"}
    assert all(r.t60_s == pytest.approx(kept[r.body, r.octave_hz], rel=0.05) for r in found)
