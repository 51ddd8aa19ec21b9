"""From a recipe to what loaders read, by the command line: each layout read back by its own reader."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run

SR = 12_000
RECIPE = """
SECONDS = 0.31
MICROPHONE = [(0, -1, 0.5), (0.2, -1, 0.5)]

def parameters(rng):
    return {"object": f"box {rng.integers(9)}", "height_m": rng.uniform(0.01, 0.03)}

def build(client, object, height_m):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    box = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.05, 0.01])
    body = client.createMultiBody(1.5, box, basePosition=[0, 0, 0.01 + height_m])
    return {floor: {"material": "concrete", "name": "floor"}, body: {"material": "steel", "count": 4, "name": object}}
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.py").write_text(RECIPE)
    return tmp_path


def manifest() -> list[dict[str, Any]]:
    return [json.loads(line) for line in Path("out", "manifest.jsonl").read_text().splitlines()]


def contents(folder: str) -> dict[str, bytes]:
    return {str(one.relative_to(folder)): one.read_bytes() for one in Path(folder).rglob("*") if one.is_file()}


def sound_of(sample: dict[str, Any]) -> np.ndarray:
    return np.asarray(soundfile.read(Path("out", sample["audio"]), always_2d=True)[0].T)


def make(*formats: str, folder: str = "out", count: int = 8) -> int:
    words = [word for name in formats for word in ("--format", name)]
    return run("dataset", "fall.py", "-o", folder, "--count", count, "--sr", SR, *words)


def test_each_layout_holds_every_sample_in_its_split(place: Path) -> None:
    assert make("audiofolder", "webdataset", "zarr") == 0
    made = manifest()
    assert len({one["split"] for one in made}) > 1
    by_split: dict[str, list[dict[str, Any]]] = {}
    for one in made:
        by_split.setdefault(one["split"], []).append(one)
    for split, samples in by_split.items():
        check_audio_folder(Path("out", "audiofolder", split), samples)
        check_tar_shards(Path("out", "webdataset"), split, samples)
        check_replay_buffer(Path("out", "zarr"), split, samples)
    # the same bytes in two goes, and with a format asked for later
    assert make(folder="later", count=3) == 0
    assert make("audiofolder", "webdataset", "zarr", folder="later") == 0
    assert contents("later") == contents("out")


def check_audio_folder(folder: Path, samples: list[dict[str, Any]]) -> None:
    lines = [json.loads(line) for line in (folder / "metadata.jsonl").read_text().splitlines()]
    assert [one["number"] for one in lines] == [one["number"] for one in samples]
    for line, one in zip(lines, samples, strict=True):
        assert np.array_equal(soundfile.read(folder / line["file_name"])[0].T, sound_of(one))
        assert line["object"] == one["object"] and line["contacts"] == one["contacts"]


def check_tar_shards(folder: Path, split: str, samples: list[dict[str, Any]]) -> None:
    from webdataset import WebDataset

    shards = sorted(map(str, folder.glob(f"{split}-*.tar")))
    read = list(WebDataset(shards, shardshuffle=False).decode())
    assert [one["__key__"] for one in read] == [f"{one['number']:06d}" for one in samples]
    for got, one in zip(read, samples, strict=True):
        assert got["json"] == {key: value for key, value in one.items() if key != "audio"}
        assert got["wav"] == Path("out", one["audio"]).read_bytes()


def check_replay_buffer(folder: Path, split: str, samples: list[dict[str, Any]]) -> None:
    import zarr

    root = zarr.open_group(zarr.storage.ZipStore(folder / f"{split}.zarr.zip", mode="r"), mode="r")
    ends = np.asarray(root["meta/episode_ends"][:])
    assert root.metadata.zarr_format == 2 and len(ends) == len(samples)
    assert root["data/mic_0"].shape == (ends[-1], SR // 60)
    for one, start, end in zip(samples, [0, *ends[:-1]], ends, strict=True):
        sound = sound_of(one)
        for number, channel in enumerate(sound):
            rows = np.asarray(root[f"data/mic_{number}"][start:end]).reshape(-1)
            assert np.array_equal(rows[: len(channel)], channel) and not rows[len(channel) :].any()
            assert len(rows) - len(channel) < SR // 60
    lines = [json.loads(line) for line in (folder / f"{split}.jsonl").read_text().splitlines()]
    assert [one["number"] for one in lines] == [one["number"] for one in samples]


@pytest.mark.slow
def test_hugging_face_reads_the_audio_folder(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    pytest.importorskip("datasets")
    from datasets import Audio, load_dataset

    # imported even where nothing is encoded, and with PyTorch behind it
    monkeypatch.setattr(Audio, "encode_example", lambda _, path: {"bytes": None, "path": path})
    assert make("audiofolder") == 0
    read = load_dataset("audiofolder", data_dir="out/audiofolder", cache_dir="hf").cast_column(
        "audio", Audio(decode=False)
    )
    made = manifest()
    assert set(read) == {one["split"] for one in made}
    for split, rows in read.items():
        samples = [one for one in made if one["split"] == split]
        assert [row["number"] for row in rows] == [one["number"] for one in samples]
        for row, one in zip(rows, samples, strict=True):
            assert np.array_equal(soundfile.read(row["audio"]["path"])[0].T, sound_of(one))
            assert row["contacts"] == one["contacts"] and row["parameters"] == one["parameters"]


READER = """
import json, sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset

told = {}
for split in sys.argv[1:]:
    read = LeRobotDataset("sonic_bullet/" + split, root="out/lerobot/" + split)
    rows = [read[number] for number in range(len(read))]
    mics = sorted(name for name in rows[0] if name.startswith("observation.audio."))
    told[split] = {
        "fps": read.fps, "episodes": read.num_episodes, "version": read.meta.info["codebase_version"],
        "episode": [int(row["episode_index"]) for row in rows], "task": [row["task"] for row in rows],
        "timestamp": [float(row["timestamp"]) for row in rows],
        "sound": [[row[mic].tolist() for row in rows] for mic in mics],
    }
print(json.dumps(told))
"""


def python_with_lerobot() -> str:
    """The interpreter of the environment that `make test-all` makes for LeRobot's library, or this one."""
    own = Path(__file__).resolve().parents[2] / ".venv" / "lerobot" / "bin" / "python"
    for python in (str(own), sys.executable):
        if own.exists() or python == sys.executable:
            found = "import importlib.util as u; raise SystemExit(u.find_spec('lerobot') is None)"
            if subprocess.run([python, "-c", found], check=False).returncode == 0:
                return python
    pytest.skip("could not import lerobot: `make .venv/lerobot.stamp` makes its environment, 8 GB")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_lerobot_reads_what_its_own_library_wrote(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = python_with_lerobot()
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(place / "hf"))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    words = [python, "-m", "sonic_bullet", "dataset", "fall.py", "--count", "8", "--sr", str(SR), "--format", "lerobot"]
    for folder in ("out", "again"):
        subprocess.run([*words, "-o", folder], check=True)
    assert contents("out") == contents("again")
    by_split: dict[str, list[dict[str, Any]]] = {}
    for one in manifest():
        by_split.setdefault(one["split"], []).append(one)
    assert len(by_split) > 1
    read = subprocess.run([python, "-c", READER, *by_split], check=True, capture_output=True, text=True)
    told = json.loads(read.stdout.splitlines()[-1])
    for split, samples in by_split.items():
        got = told[split]
        assert (got["version"], got["fps"], got["episodes"]) == ("v3.0", 60, len(samples))
        lines = Path("out", "lerobot", f"{split}.jsonl").read_text().splitlines()
        assert [json.loads(line)["number"] for line in lines] == [one["number"] for one in samples]
        episode = np.array(got["episode"])
        for number, one in enumerate(samples):
            rows = np.flatnonzero(episode == number)
            assert {got["task"][row] for row in rows} == {one["object"]}
            assert np.allclose([got["timestamp"][row] for row in rows], np.arange(len(rows)) / 60)
            for heard, channel in zip(np.array(got["sound"], np.float32), sound_of(one), strict=True):
                whole = heard[rows].ravel()
                assert np.array_equal(whole[: len(channel)], channel.astype(np.float32))
                assert not whole[len(channel) :].any() and len(whole) - len(channel) < SR // 60


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("parquet", "there is no format parquet; one of audiofolder, lerobot"),
        ("zar", "did you mean zarr"),
        ("lerobots", "did you mean lerobot"),
    ],
)
def test_an_unknown_format_is_one_line_and_makes_nothing(
    place: Path, name: str, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert said in error_of(capfd, "dataset", "fall.py", "-o", "out", "--count", "2", "--format", name)
    assert not Path("out").exists()


def test_what_a_layout_cannot_hold_is_one_line_and_the_samples_are_kept(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    said = error_of(capfd, "dataset", "fall.py", "-o", "out", "--count", "1", "--sr", "8000", "--format", "zarr")
    assert "60 rows a second" in said
    assert len(manifest()) == 1 and not Path("out", "zarr").exists()
