"""A record goes to a file and comes back; what is no such file is one line with file, key and remedy."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import msgspec
import numpy as np
import pytest

from sonic_bullet.files.storage.json_records import fill_record, read_record, record_schema, write_record
from sonic_bullet.records.errors import FileError

VERSION = "tone/2"


class Tone(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A tone."""

    format: str
    freq_hz: Annotated[float, msgspec.Meta(gt=0, description="Hz, above zero")]
    name: Annotated[str, msgspec.Meta(description="in words")] = ""


def read(path: Path) -> Tone:
    return read_record(path, Tone, "tone", FileError, "sing it again", version=VERSION, most_bytes=1 << 20)


@pytest.mark.parametrize("indent", [None, 2])
def test_a_record_comes_back(tmp_path: Path, indent: int | None) -> None:
    tone = Tone(VERSION, 440.0)
    write_record(tmp_path / "a.json", tone, indent=indent)
    assert read(tmp_path / "a.json") == tone
    assert (tmp_path / "a.json").read_bytes().endswith(b"}\n")
    assert json.loads((tmp_path / "a.json").read_text()) == {"format": VERSION, "freq_hz": 440.0}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"format": "tone/1", "pitch": 3}, "has format 'tone/1', which is no longer read; make it anew"),
        ({"format": "tone/3", "pitch": 3}, "has format 'tone/3', wanted 'tone/2'; use a sonic_bullet that knows"),
        ({"format": "tone/" + "0" * 5000}, "wanted 'tone/2'"),
        ({"format": "noise/1"}, "has format 'noise/1', wanted 'tone/2'"),
        ({"freq_hz": 3}, ": field 'format' is missing; sing it again"),
        ({"format": VERSION, "freq_hz": 0}, ": freq_hz is 0, wanted a number above 0; sing it again"),
        ({"format": VERSION, "freq_hz": "a"}, ': freq_hz is "a", wanted a number; sing it again'),
        ({"format": VERSION, "freq_hz": 1, "nam": ""}, ": field 'nam' is not known: did you mean 'name'?; sing it"),
        ({"format": VERSION, "freq_hz": 1, "name": "x" * (1 << 20)}, "is over 1 MiB; sing it again"),
    ],
)
def test_what_is_no_such_record_is_one_line(tmp_path: Path, content: Any, said: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError) as error:
        read(path)
    assert str(path) in str(error.value) and said in str(error.value) and "\n" not in str(error.value)


def test_a_folder_and_a_missing_file_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="it is a folder; name a file inside it"):
        read(tmp_path)
    with pytest.raises(FileError, match=r"cannot read tone .*none\.json: No such file or directory; check the path"):
        read(tmp_path / "none.json")


def test_a_record_is_filled_by_name(tmp_path: Path) -> None:
    """Scalars of numpy become plain numbers, and what UTF-8 has not a question mark."""
    made = fill_record(Tone, SimpleNamespace(freq_hz=np.float32(0.5), name="a\udc80", other=1), format=VERSION)
    assert made == Tone(VERSION, 0.5, "a?") and type(made.freq_hz) is float
    write_record(tmp_path / "a.json", made)
    assert read(tmp_path / "a.json") == made


def test_a_schema_is_made_of_the_record() -> None:
    schema = record_schema(Tone, VERSION)
    assert schema["title"] == VERSION
    assert schema["$defs"]["Tone"]["properties"]["freq_hz"] == {
        "description": "Hz, above zero",
        "type": "number",
        "exclusiveMinimum": 0,
    }
