"""From a recipe to a data set by the command line: labels, splits, the same bytes whatever interrupts, bad recipes."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonic_bullet.apps.dataset import sample_folder
from sonic_bullet.apps.dataset.object_splits import splits_of
from sonic_bullet.apps.dataset.sample_folder import open_folder
from sonic_bullet.apps.jobs.job_driver import JobWorkers, finish_jobs
from sonic_bullet.apps.jobs.job_folder import append_json_line
from sonic_bullet.apps.jobs.job_processes import ATTEMPTS, Failure, run_jobs
from sonic_bullet.files import read_audio
from sonic_bullet.files.storage.atomic import cannot
from sonic_bullet.machine.progress import progress_to
from sonic_bullet.options.dataset import read_shares
from sonic_bullet.records.errors import FileError
from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few

MASS_KG = 1.5
RECIPE = f"""
SECONDS = 0.4

def parameters(rng):
    return {{"object": f"box {{rng.integers(4)}}", "height_m": rng.uniform(0.02, 0.05)}}

def build(client, object, height_m):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    box = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.05, 0.01])
    body = client.createMultiBody({MASS_KG}, box, basePosition=[0, 0, 0.01 + height_m])
    client.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
    return {{floor: {{"material": "concrete", "name": "floor"}},
            body: {{"material": "steel", "count": 4, "name": object}}}}
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.py").write_text(RECIPE)
    return tmp_path


def dataset(*words: object) -> int:
    return run("dataset", *words, "--sr", 8000)


def contents(folder: Path | str) -> dict[str, bytes]:
    root = Path(folder)
    return {str(one.relative_to(root)): one.read_bytes() for one in root.rglob("*") if one.is_file()}


def manifest(folder: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in Path(folder, "manifest.jsonl").read_text().splitlines()]


def test_every_sample_is_sound_with_its_labels_and_none_is_made_twice(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert dataset("fall.py", "-o", "one", "--count", 4, "--seed", 3, "--workers", 1) == 0
    samples = manifest("one")
    assert [one["number"] for one in samples] == [0, 1, 2, 3]
    splits: dict[str, set[str]] = {}
    for one in samples:
        splits.setdefault(one["object"], set()).add(one["split"])
        sound, sr = read_audio(Path("one", one["audio"]))
        assert sr == one["sr"] == 8000 and sound.shape == (1, 3200)
        assert np.abs(sound).max() == pytest.approx(one["peak_pa"], rel=1e-6)
        first = one["contacts"][0]
        assert sorted(first["bodies"]) == sorted(["floor", one["object"]])
        assert sorted(first["materials"]) == ["concrete", "steel"]
        speed = np.sqrt(2 * 9.81 * one["parameters"]["height_m"])
        assert first["start_s"] == pytest.approx(speed / 9.81, abs=2 / 240)
        # momentum: what stops the fall and carries the weight until the end
        rest_s = first["end_s"] - first["start_s"]
        assert first["impulse_n_s"] == pytest.approx(MASS_KG * (speed + 9.81 * rest_s), rel=0.03)
        assert first["place_m"][2] == pytest.approx(0, abs=speed / 240)  # the gap at the start of the step
        assert one["seed"] == [3, one["number"]] and one["versions"]["pybullet"]
    assert all(len(found) == 1 for found in splits.values())
    before = contents("one")
    capfd.readouterr()
    assert dataset("fall.py", "-o", "one", "--count", 4, "--seed", 3) == 0
    assert "0 made now" in capfd.readouterr().out and contents("one") == before
    assert dataset("fall.py", "-o", "two", "--count", 2, "--seed", 3, "--workers", 2) == 0
    assert dataset("fall.py", "-o", "two", "--count", 4, "--seed", 3, "--workers", 2) == 0
    assert contents("two") == before


def test_few_objects_fill_their_splits_and_more_samples_move_none(place: Path) -> None:
    assert dataset("fall.py", "-o", "one", "--count", 2, "--shares", "2,1,1") == 0
    before = {one["number"]: one["split"] for one in manifest("one")}
    assert dataset("fall.py", "-o", "one", "--count", 6, "--shares", "2,1,1") == 0
    samples = manifest("one")
    of = {one["object"]: one["split"] for one in samples}
    assert sorted(of.values()) == ["test", "train", "validation"]
    assert all(one["split"] == of[one["object"]] for one in samples)
    assert {number: samples[number]["split"] for number in before} == before
    assert dataset("fall.py", "-o", "rest", "--first", 4, "--count", 2, "--shares", "2,1,1") == 0
    assert manifest("rest") == samples[4:]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(0.01, 1), min_size=3, max_size=3), st.lists(st.integers(0, 60), max_size=200))
def test_each_split_has_its_share_to_within_one_object(weights: list[float], drawn: list[int]) -> None:
    shares = read_shares(",".join(map(str, weights)))
    splits = splits_of(map(str, drawn), shares)
    for split, share in shares.items():
        assert abs(list(splits.values()).count(split) - share * len(splits)) < 1
    half = splits_of(map(str, drawn[: len(drawn) // 2]), shares)
    assert half == {name: splits[name] for name in half}


@pytest.mark.parametrize("shares", ["8,1", "a,b,c", "1,-1,1", "0,0,0"])
def test_what_are_no_shares_is_one_line(place: Path, shares: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert "8,1,1" in error_of(capfd, "dataset", "fall.py", "-o", "out", "--count", "2", "--shares", shares)


@parametrize_few("kills", [1, 20])
def test_kills_change_no_byte(place: Path, kills: int) -> None:
    count = 3 if kills == 1 else 24
    assert dataset("fall.py", "-o", "whole", "--count", count) == 0
    words = ["dataset", "fall.py", "-o", "cut", "--count", str(count), "--sr", "8000", "--workers", "2"]
    for number in range(kills):
        running = subprocess.Popen([sys.executable, "-m", "sonic_bullet", *words], stderr=subprocess.DEVNULL)
        until = time.monotonic() + 120
        while len(list(Path("cut").rglob("*.json"))) < 2 + number and running.poll() is None:
            assert time.monotonic() < until
            time.sleep(0.01)
        running.send_signal(signal.SIGKILL)
        running.wait()
        listed = [one["audio"] for one in manifest("cut")]
        done = {str(one.relative_to("cut").with_suffix(".wav")) for one in Path("cut", "samples").rglob("*.json")}
        assert len(set(listed)) == len(listed) and set(listed) <= done
        assert len(done) <= len(listed) + 1  # killed between a sample and its line
    until = time.monotonic() + 30
    while run(*words) and time.monotonic() < until:  # a killed run's processes may still be ending
        time.sleep(0.1)
    assert contents("cut") == contents("whole")


@parametrize_few("stops", [1, 2])
def test_a_run_that_is_stopped_says_what_it_keeps_and_how_it_goes_on(place: Path, stops: int) -> None:
    words = ["dataset", "fall.py", "-o", "cut", "--count", "40", "--sr", "8000", "--workers", "1"]
    # a shell's background jobs are started deaf to SIGINT
    awake = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    main = f"{awake}from sonic_bullet.apps.cli import main; main()"
    running = subprocess.Popen([sys.executable, "-c", main, *words], stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while len(list(Path("cut").rglob("00*.json"))) < 2 and running.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.01)
    for _ in range(stops):
        running.send_signal(signal.SIGINT)
        time.sleep(0.25)
    said = running.communicate()[1].splitlines()[-1]
    listed = manifest("cut")
    again = f"the same command goes on: sonic-bullet {' '.join(words)}"
    assert running.returncode == 130
    assert said == f"sonic-bullet: stopped; {len(listed)} of 40 samples kept in {place / 'cut'}; {again}"
    assert len(listed) == len(list(Path("cut").rglob("00*.json")))


def test_lists_and_progress_follow_each_job(place: Path) -> None:
    """Of five jobs of which one was done before: counts are of all, and a failure is listed before the next job."""
    said, lists = list[str](), list[tuple[int, dict[int, str]]]()

    def do(item: int) -> int | Failure:
        return Failure("odd") if item == 3 else item

    with progress_to(said.append):
        made, failures = finish_jobs(
            do, [1, 2, 3, 4], JobWorkers(1, 60.0), count=5, nouns="samples", place="out",
            keep=lambda item, found: None, write_lists=lambda failed: lists.append((0, dict(failed))),
            update_lists=lambda item, failed: lists.append((item, dict(failed))), describe=lambda: "!",
        )  # fmt: skip
    assert (made, failures) == (3, {3: "odd"}) and lists[0] == (0, {}) and lists[-1] == (0, failures)
    assert dict(lists[1:-1]) == {1: {}, 2: {}, 3: {3: "odd"}, 4: {3: "odd"}}
    assert said[0] == "1 of 5!" and "3 of 5!" in said and said[-1] == "4 of 5, 1 failed!"


def test_a_line_is_appended_whole_or_not_at_all(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, real = place / "list.jsonl", os.write
    append_json_line(file, {"number": 1})
    with monkeypatch.context() as full:
        full.setattr(os, "write", lambda fd, data: real(fd, data[:3]))
        with pytest.raises(FileError, match="disk full"):
            append_json_line(file, {"number": 2})
    append_json_line(file, {"number": 3})
    assert [json.loads(line)["number"] for line in file.read_text().splitlines()] == [1, 3]


def test_a_full_disk_keeps_what_is_whole_and_is_gone_on_from(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    real = sample_folder.write_audio

    def until_it_is_full(path: Path, *more: Any, **how: Any) -> None:
        if path.name == "000002.wav":
            raise cannot("write", path, OSError(errno.ENOSPC, "No space left on device"))
        real(path, *more, **how)

    how = ("fall.py", "-o", "one", "--count", 3, "--workers", 1)
    monkeypatch.setattr(sample_folder, "write_audio", until_it_is_full)
    assert dataset(*how) == 2
    assert "disk full" in capfd.readouterr().err
    assert [one["number"] for one in manifest("one")] == [0, 1]
    monkeypatch.setattr(sample_folder, "write_audio", real)
    assert dataset(*how) == 0
    assert dataset("fall.py", "-o", "two", "--count", 3) == 0
    assert contents("one") == contents("two")


ON_A_SMALL_DISK = """
mount -t tmpfs -o size=72k tmpfs small || exit 77
"$@"; code=$?
cp -r small cut
mount -o remount,size=20m small
"$@" && cp -r small finished && exit $code
"""


@pytest.mark.slow
def test_a_disk_that_is_really_full_is_one_line_and_the_same_command_gives_the_same_bytes(place: Path) -> None:
    Path("small").mkdir()
    words = [sys.executable, "-m", "sonic_bullet", "dataset", "fall.py", "--count", "5", "--sr", "12000", "-o"]
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-m", "true"], check=False, capture_output=True).returncode:
        pytest.skip("no mount namespace")
    on_it = [unshare, "-m", "bash", "-c", ON_A_SMALL_DISK, "bash", *words, "small"]
    done = subprocess.run(on_it, check=False, capture_output=True, text=True)
    if done.returncode == 77:
        pytest.skip("no mount namespace")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "disk full; free space or choose another place" in done.stderr
    # what was finished is kept and listed, nothing half-written has a name
    listed = [one["audio"] for one in manifest("cut")]
    assert 0 < len(listed) < 5
    assert sorted(listed) == sorted(str(one.relative_to("cut")) for one in Path("cut").rglob("*.wav"))
    assert subprocess.run([*words, "whole"], check=False).returncode == 0
    assert contents("finished") == contents("whole")


def test_what_fails_is_listed_and_the_rest_goes_on(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text = RECIPE.replace(
        "def build(client, object, height_m):",
        "def build(client, object, height_m):\n"
        "    if height_m > 0.04:\n        raise ValueError('too high')\n"
        "    if height_m < 0.03:\n        return {}",
    )
    Path("some.py").write_text(text)
    assert dataset("some.py", "-o", "out", "--count", 5) == 1
    made = [one["number"] for one in manifest("out")]
    failed = [json.loads(line) for line in Path("out", "failures.jsonl").read_text().splitlines()]
    assert sorted(made + [one["number"] for one in failed]) == [0, 1, 2, 3, 4] and made
    reasons = " ".join(one["reason"] for one in failed)
    assert "some.py' line 9: ValueError: too high" in reasons and "makes no sound" in reasons
    assert "ValueError: too high" in capfd.readouterr().out


@pytest.mark.slow
def test_a_sample_that_takes_all_memory_ends_alone(place: Path) -> None:
    text = RECIPE.replace(
        "def build(client, object, height_m):",
        "def build(client, object, height_m):\n    if height_m > 0.035:\n        list(range(10**12))",
    )
    Path("greedy.py").write_text(text)
    words = [sys.executable, "-m", "sonic_bullet", "dataset", "greedy.py", "-o", "out", "--count", "4", "--sr", "8000"]
    # 2 GB more than what the command itself takes
    done = subprocess.run(["bash", "-c", 'ulimit -v 6000000; exec "$@"', "bash", *words], check=False)
    assert done.returncode == 1
    failed = [json.loads(line) for line in Path("out", "failures.jsonl").read_text().splitlines()]
    made = [one["number"] for one in manifest("out")]
    assert made and failed and sorted(made + [one["number"] for one in failed]) == list(range(4))
    assert all("MemoryError" in one["reason"] for one in failed)


def hang_or_end(number: int) -> int:
    """A job that ends, hangs, or ends its process."""
    if number == 1:
        time.sleep(60)
    if number == 2:
        signal.raise_signal(signal.SIGKILL)
    return number * number


def test_a_job_that_never_ends_or_kills_its_process_stops_no_other() -> None:
    found = dict(run_jobs(hang_or_end, range(4), workers=2, limit_s=0.5))
    assert found[0] == 0 and found[3] == 9
    assert found[1] == Failure("it took more than 0.5 s")
    assert isinstance(found[2], Failure) and "SIGKILL" in found[2].reason


def test_a_job_is_tried_three_times(tmp_path: Path) -> None:
    def third(number: int) -> int:
        tried = tmp_path / f"{number}-{len(list(tmp_path.iterdir()))}"
        tried.touch()
        if len(list(tmp_path.iterdir())) < ATTEMPTS:
            raise ValueError("not yet")
        return number

    assert list(run_jobs(third, [7], workers=1, limit_s=10)) == [(7, 7)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "no recipe"),
        ("def sample(", "SyntaxError"),
        ("x = 1", "no function sample(rng)"),
        ("raise RuntimeError('at once')", "line 1: RuntimeError: at once"),
    ],
)
def test_what_is_no_recipe_is_one_line(
    place: Path, text: str | None, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    if text is not None:
        Path("bad.py").write_text(text)
    assert said in error_of(capfd, "dataset", "bad.py", "-o", "out", "--count", "2")
    assert not Path("out").exists()


def test_a_folder_is_of_one_data_set_and_one_run(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    about = {"recipe": "fall.py", "seed": 0}
    twice = pytest.raises(FileError, match="another run writes out")
    with open_folder("out", about), twice, open_folder("out", about):
        pass
    with pytest.raises(FileError, match="data set of another seed"), open_folder("out", {**about, "seed": 1}):
        pass
    Path("full").mkdir()
    Path("full", "thesis.txt").write_text("words")
    assert "full holds other files" in error_of(capfd, "dataset", "fall.py", "-o", "full", "--count", "2")
    assert [one.name for one in Path("full").iterdir()] == ["thesis.txt"]
