"""The page of recordings by others says what the commands' JSON says: takes held out, refusals, effects, ratios."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import soundfile

from benchmarks.measured import Object, kept, made_case, own_row, page, row, words


def _take(split: str, predicted: float, silence: float = 20.0, other: float | None = 4.0) -> dict[str, Any]:
    return {"split": split, "predicted_db": predicted, "silence_db": silence, "other_take_db": other}


def _object(name: str) -> Object:
    return Object(name, "set", ())


MUG = {
    "fit": {"verdict": "fitted", "takes": [_take("holdout", 8.0), _take("holdout", 10.0, 24.0, 6.0)]},
    "residual": {
        "takes": [
            _take("holdout", 5.0) | {"levels_db": 3.0, "other_take_levels_db": 2.5},
            _take("holdout", 7.0, 24.0, 6.0) | {"levels_db": 3.6, "other_take_levels_db": 3.5},
        ]
    },
    "diagnose": {
        "verdict": "explained",
        "effects": [{"id": "damping-law", "parameters": {"law": "constant", "eta": 0.012345}}],
        "errors": {"before": {"holdout": 9.0}, "after": {"holdout": 6.5}, "floor": 1.0},
        "unexplained": {"words": "most of it in the first third"},
        "warnings": ["case/take2.wav: it clips"],
    },
}
BELL = {
    "fit": {"verdict": "one take", "takes": [_take("fit", 3.0, 30.0, None)]},
    "residual": {"error": "no noise before the onset"},
    "diagnose": {"verdict": "none", "effects": [], "errors": {"before": {"holdout": None}, "after": {"holdout": None}}},
}
CUP = {"fit": {"error": "silence"}, "residual": {"error": "silence"}, "diagnose": {"error": "silence"}}
LOUD = {
    "fit": {"verdict": "misfit", "takes": [_take("holdout", 30.0)]},
    "residual": {"takes": [_take("holdout", 24.0)]},
    "diagnose": {"verdict": "unexplained", "effects": [], "errors": {"before": {"holdout": 25.0}, "after": {}}},
}


def test_a_row_holds_the_means_over_takes_held_out_alone() -> None:
    cells = row(_object("mug"), MUG)
    assert cells == ["mug", "2", "22.0", "5.0", "-", "9.0", "6.0", "3.3", "3.0", "9.0", "6.5", "`damping-law`"]
    assert row(_object("bell"), BELL)[1:4] == ["0", "-", "-"]
    assert own_row(_object("bell"), BELL) == ["bell", "30.0", "3.0", "-", "none"]
    assert row(_object("cup"), CUP)[-1] == "refused"
    assert row(_object("loud"), LOUD)[7:] == ["-", "-", "25.0", "-", "unexplained"], (
        "no error with effects where none is named"
    )


def test_a_refusal_is_said_with_its_line_and_counted() -> None:
    assert "residual refused: no noise before the onset" in words(_object("bell"), BELL)
    text = " ".join(page([(_object("bell"), BELL), (_object("cup"), CUP)], ["wood"]).split())
    assert "4 commands were refused: bell (`residual`), cup (`fit`), cup (`residual`), cup (`diagnose`)" in text
    assert "Not run: wood." in text


def test_the_summary_counts_ratios_silence_and_what_effects_gain() -> None:
    text = " ".join(page([(_object("mug"), MUG), (_object("bell"), BELL), (_object("loud"), LOUD)]).split())
    assert "4.65 times the distance to the nearest other take at the median of 2 objects, 7.50 times at worst" in text
    assert "1.10 times the distance to the nearest other take at the median of 1 objects" in text
    assert "3.60 times" in text and "It is nearer than silence in 2 of 3 takes" in text
    assert "names effects for 1 of 2 objects with takes held out; the error on these falls for 1" in text
    assert "0.0 dB farther" not in text and "-2.5 dB farther" in text
    assert "effect: damping-law, law constant, eta 0.0123" in text
    assert "left: most of it in the first third warned: take2.wav: it clips" in text
    assert text.index("| mug |") < text.index("## No take held out") < text.index("| bell |")


def test_every_second_take_of_a_case_is_held_out(tmp_path: Path) -> None:
    rate = 8000
    soundfile.write(tmp_path / "long.wav", [0.0] * 400 + [0.5] * 4 + [0.0] * 4000, rate)
    takes = tuple((tmp_path / "long.wav", start, start + 0.5) for start in (0.0, 0.01, 0.02))
    folder = made_case(Object("a, b", "set", takes), kept(_object("a, b"), tmp_path).parent / "case")
    import json

    case = json.loads((folder / "case.json").read_text())
    assert folder.parent.name == "a--b"
    assert [r["split"] for r in case["recordings"]] == ["fit", "holdout", "fit"]
