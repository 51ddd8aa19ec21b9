"""Cases are whole, readable, blind and repeatable; rows become the counts they should."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.suite import cases, objects, plans, sounding
from benchmarks.suite.cases import Plan, make_case
from benchmarks.suite.effects import LISTED, UNLISTED
from benchmarks.suite.run import diagnose, rows, write_row
from benchmarks.suite.tables import report
from sonic_bullet.files.cases import read_case


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> str:
    bar = objects.Recipe("small", "steel", (10, 2, 1), lambda u: (u - 0.5) * np.array([0.16, 0.02, 0.008]))
    monkeypatch.setitem(cases.RECIPES, "small", bar)
    return "small"


def test_a_case_reads_and_says_nothing_of_its_truth(small: str, tmp_path: Path) -> None:
    plan = Plan("one", small, (("foreign-mode", 1), ("contact-time", 2)), 3, transfer=True, seconds=0.5)
    truth = make_case(tmp_path, plan, tmp_path / "modes")
    case = read_case(tmp_path / "one")
    assert [r.split for r in case.recordings] == ["fit"] * 5 + ["holdout"] * 3 + ["transfer"] * 2
    assert case.sensor == "velocity"
    assert case.onset_s == 0.0
    text = (tmp_path / "one" / "case.json").read_text()
    assert "foreign" not in text
    assert "tau" not in text
    assert [e["id"] for e in truth["effects"]] == ["foreign-mode", "contact-time"]
    vertex = np.array(
        [line.split()[1:] for line in (tmp_path / "one" / "small.obj").read_text().splitlines() if line[0] == "v"],
        float,
    )
    for r in case.recordings[:8]:
        assert np.linalg.norm(vertex - np.array(r.position_m), axis=1).min() < 2e-6
        assert r.file is not None
        assert r.file.exists()


def test_the_same_plan_gives_the_same_bytes(small: str, tmp_path: Path) -> None:
    plan = Plan("one", small, (("room", 2),), 4, seconds=0.5)
    for place in ("a", "b"):
        make_case(tmp_path / place, plan, tmp_path / place / "modes")
    for file in sorted((tmp_path / "a" / "one").iterdir()):
        assert file.read_bytes() == (tmp_path / "b" / "one" / file.name).read_bytes(), file.name


def test_a_null_lies_at_its_floor_and_an_effect_beyond_it(small: str, tmp_path: Path) -> None:
    null = make_case(tmp_path, Plan("null", small, (), 5, seconds=0.5), tmp_path / "modes")["distance_db"]
    assert null["effect"] == pytest.approx(null["floor"], abs=0.5)
    moved = make_case(tmp_path, Plan("law", small, (("damping-law", 2),), 5, seconds=0.5), tmp_path / "modes")[
        "distance_db"
    ]
    assert moved["effect"] > moved["floor"] + 1


def test_each_of_a_pair_is_heard_beside_the_other(small: str, tmp_path: Path) -> None:
    plan = Plan("two", small, (("foreign-mode", 1), ("contact-time", 2)), 3, seconds=0.5)
    truth = make_case(tmp_path, plan, tmp_path / "modes")
    heard = truth["beside_db"]
    assert list(heard) == ["foreign-mode", "contact-time"]
    assert sounding.beyond(heard["foreign-mode"]) > 1.8
    assert sounding.beyond(heard["contact-time"]) > 3
    # one that the other hides makes no pair, however loud both are together
    assert (
        sounding.short_of(
            (1, 2), {"effect": 9.0, "floor": 1.0}, [{"effect": 9.0, "floor": 1.0}, {"effect": 1.0, "floor": 1.0}]
        )
        == 3.0
    )
    assert (
        sounding.short_of(
            (1, 2), {"effect": 9.0, "floor": 1.0}, [{"effect": 9.0, "floor": 1.0}, {"effect": 4.0, "floor": 1.0}]
        )
        == 0.0
    )


def test_lines_and_cases_without_a_mesh_read(small: str, tmp_path: Path) -> None:
    make_case(tmp_path, Plan("lines", small, (), 6, form="features", seconds=0.5), tmp_path / "modes")
    make_case(tmp_path, Plan("bare", small, (), 6, form="no-mesh", seconds=0.5), tmp_path / "modes")
    lines = read_case(tmp_path / "lines")
    assert all(r.lines for r in lines.recordings)
    assert read_case(tmp_path / "bare").objects["small"].mesh is None


def test_plans_are_as_many_as_the_suite_promises_and_names_differ() -> None:
    assert (len(plans.singles()), len(plans.nulls()), len(plans.pairs())) == (78, 50, 20)
    whole = plans.whole()
    assert len({p.name for p in whole}) == len(whole) == 166
    assert {e for p in whole for e, _ in p.effects} == {*LISTED, *UNLISTED}
    assert all(p.recipe in cases.RECIPES for p in whole)


def test_another_draw_has_the_same_questions_and_other_numbers() -> None:
    first, other = plans.whole(), plans.whole(1)
    assert [(p.name, [e for e, _ in p.effects]) for p in first] == [(p.name, [e for e, _ in p.effects]) for p in other]
    assert not {p.seed for p in first} & {p.seed for p in other}
    assert all(a.recipe != b.recipe for a, b in zip(plans.nulls(), plans.nulls(draw=1), strict=True))
    assert plans.whole(1) == other


def test_the_command_sees_no_truth_and_a_broken_answer_is_a_failure(small: str, tmp_path: Path) -> None:
    make_case(tmp_path, Plan("one", small, (("room", 2),), 4, seconds=0.5), tmp_path / "modes")
    spy = tmp_path / "spy.py"
    spy.write_text(
        "import json, os, sys\n"
        "blind = 'truth.json' not in os.listdir(sys.argv[1])\n"
        "print(json.dumps({'verdict': 'explained' if blind else 'cheated', 'effects': [{'id': 'room'}], "
        "'errors': None}))\n"
    )
    row = diagnose(tmp_path / "one", f"{sys.executable} {spy} {{case}}")
    assert (row["verdict"], row["found"], row["true"]) == ("explained", ["room"], ["room"])
    broken = diagnose(tmp_path / "one", f"{sys.executable} -c pass")
    assert broken["verdict"] == "failed"
    file = tmp_path / "rows.jsonl"
    write_row(file, broken)
    write_row(file, row)
    with open(file, "a") as stream:
        stream.write('{"case": "cut sho')
    assert [r["verdict"] for r in rows(file)] == ["explained"]


def test_a_case_ends_by_its_processor_time_and_not_by_the_clock(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_case(tmp_path, Plan("one", small, (), 4, seconds=0.5), tmp_path / "modes")
    monkeypatch.setattr("benchmarks.suite.run.LIMIT_CPU_S", 1)
    waits = f"{sys.executable} -c 'import time; time.sleep(1.5)'"
    works = f"{sys.executable} -c 'while True: pass'"
    assert "processor" not in diagnose(tmp_path / "one", waits)["why"]
    assert "1 s of processor time" in diagnose(tmp_path / "one", works)["why"]


def test_the_report_counts_names_alarms_and_pairs() -> None:
    base = {
        "verdict": "explained",
        "cpu_s": 1.0,
        "errors": {"before": {"holdout": 4.0}, "after": {"holdout": 2.0}, "floor": 2.0},
    }
    made = [
        {**base, "case": "single-room-weak-0", "true": ["room"], "found": ["room"]},
        {**base, "case": "single-room-weak-1", "true": ["room"], "found": ["rebound"]},
        {**base, "case": "null-00", "true": [], "found": ["room"]},
        {**base, "case": "null-01", "true": [], "found": [], "verdict": "none", "errors": None},
        {**base, "case": "pair-a+b", "true": ["added-mass", "room"], "found": ["added-mass", "room"]},
        {**base, "case": "unlisted-buzz-strong", "true": ["unlisted:buzz"], "found": [], "verdict": "unexplained"},
    ]
    text = report(json.loads(json.dumps(made)), 166)
    assert "6 of 166 cases judged, 0 failed" in text
    assert "singles named: 1 of 2; a wrong name in 1 of 3" in text
    assert "false alarms: 1 of 2 nulls" in text
    assert "both found 1 of 1, exactly 1" in text
    assert "named wrongly 0 of 1" in text
    assert "100 %" in text
