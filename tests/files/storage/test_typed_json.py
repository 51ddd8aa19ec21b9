"""What does not fit a typed JSON file is one line in our words: file, key, what is there, what is wanted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet.apps.soundtrack.score.keyframes import read_keyframes, read_rules
from sonic_bullet.files.case_fields import CaseFile
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.presets import read_preset
from sonic_bullet.files.storage.typed_json import decode_json
from sonic_bullet.records.errors import AnimationError, FileError, SonicBulletError

CASE = {"format": "sonic-bullet-case/1", "recordings": []}
ANIMATION = {"format": "sonic-bullet-animation/1", "fps": 24, "bodies": []}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "case: the whole is a list of 0, wanted an object {…}"),
        ({}, "case: field 'format' is missing"),
        (CASE | {"recordings": "none"}, 'case: recordings is "none", wanted a list [...]'),
        (
            CASE | {"recordings": [{}, {"strike": {"position": [1, 2]}}]},
            "case: recordings 2: strike: position is a list of 2, wanted a list of 3",
        ),
        (CASE | {"band_hz": [20, "x" * 99]}, f'case: band_hz 2 is "{"x" * 29}…, wanted a number'),
        (CASE | {"band_hz": [1e9, 2]}, "case: band_hz 1 is 1000000000.0, wanted a number of at most 10000000"),
        (
            CASE | {"objects": {"cup": {"mesh": "a.obj"}, "lid": {"mesh": 3}}},
            "case: objects: lid: mesh is 3, wanted a text or null",
        ),
        ("{", "case: the JSON ends too early"),
        ("", "case: the file is empty, wanted JSON"),
        ('{"format": 1,\n "a": x}', "case: line 2, column 7 is no JSON (invalid character)"),
        ("[" * 5000, "case: lists and objects are nested too deep"),
    ],
)
def test_a_misfit_names_key_and_what_is_wanted(content: Any, words: str) -> None:
    text = content if isinstance(content, str) else json.dumps(content)
    with pytest.raises(FileError) as error:
        decode_json(text.encode(), CaseFile, "case", FileError, "mend it")
    assert str(error.value) == f"{words}; mend it"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (ANIMATION | {"up": "x"}, 'up is "x", wanted "y" or "z"'),
        (ANIMATION | {"fps": None}, "fps is null, wanted a number or a text"),
        (ANIMATION | {"bodies": [{"name": "a", "fiction": 1}]}, "bodies 1: field 'fiction' is not known"),
        (ANIMATION | {"bodies": [{"name": "a", "mass_kg": -1}]}, "mass_kg is -1, wanted a number of at least 0"),
    ],
)
def test_an_animation_file_is_refused_in_the_same_words(tmp_path: Path, content: Any, words: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    with pytest.raises(AnimationError) as error:
        read_keyframes(path)
    assert f"animation {path}: " in str(error.value) and words in str(error.value)


@pytest.mark.parametrize("read", [read_case, read_preset, read_keyframes, read_rules])
@pytest.mark.parametrize("text", ["3", '{"format": []}', "[1]", "{", "\xff"])
def test_no_reader_quotes_its_parser(tmp_path: Path, read: Any, text: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(SonicBulletError) as error:
        read(path)
    message = str(error.value)
    assert str(path) in message and "`" not in message and "Expected" not in message and "$" not in message
