"""Many cases by one command: what one case a command gives, each done once, what fails listed, on a cluster as here."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run
from tests.journeys.test_recipe_to_dataset import contents

SR = 16_000


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, freq_hz in (("fork", (440.0, 1710.0)), ("bell", (610.0, 1320.0, 2750.0))):
        write_case(tmp_path / "cases" / name, freq_hz)
    return tmp_path


def write_case(folder: Path, freq_hz: tuple[float, ...], seconds: float = 0.4) -> None:
    """Two taps of a thing that has these lines and no mesh; all decay by 12 1/s."""
    folder.mkdir(parents=True)
    t = np.arange(int(seconds * SR)) / SR
    rng = np.random.default_rng(len(freq_hz))
    for number in range(2):
        gains = rng.uniform(0.05, 0.2, len(freq_hz))
        sound = sum(g * np.exp(-12 * t) * np.sin(2 * np.pi * f * t) for g, f in zip(gains, freq_hz, strict=True))
        heard = np.concatenate([np.zeros(SR // 20), np.asarray(sound)]) + 1e-5 * rng.normal(size=len(t) + SR // 20)
        soundfile.write(folder / f"tap{number}.wav", heard, SR, subtype="FLOAT")
    taps = [{"file": f"tap{number}.wav"} for number in range(2)]
    (folder / "case.json").write_text(json.dumps({"format": "sonic-bullet-case/1", "recordings": taps}))


def cases() -> list[Path]:
    return sorted(Path("cases").iterdir())


def rows(folder: str) -> list[dict[str, str]]:
    with Path(folder, "summary.csv").open() as file:
        return list(csv.DictReader(file))


def stamps(folder: str) -> dict[str, int]:
    return {str(one): one.stat().st_mtime_ns for one in Path(folder).rglob("done.json")}


def test_many_fits_are_those_of_single_cases_each_done_once(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("fit", *cases(), "-o", "out", "--workers", 2, "--csv", "lines.csv") == 0
    assert "2 cases with a result, 2 made now" in capfd.readouterr().out
    for case in cases():
        assert run("fit", case, "-o", "p.json", "--json", "r.json", "--csv", "l.csv") == 0
        for one, among_many in (("p.json", "preset.json"), ("r.json", "result.json"), ("l.csv", "lines.csv")):
            assert Path(one).read_bytes() == Path("out", case.name, among_many).read_bytes()
    assert [row["case"] for row in rows("out")] == ["bell", "fork"]
    before = stamps("out")
    # a case that changed is done again, no other
    write_case(Path("cases", "glass"), (900.0,))
    Path("cases", "fork", "case.json").write_text(Path("cases", "fork", "case.json").read_text() + "\n")
    capfd.readouterr()
    assert run("fit", *cases(), "-o", "out", "--workers", 1, "--csv", "lines.csv") == 0
    assert "3 cases with a result, 2 made now" in capfd.readouterr().out
    after = stamps("out")
    assert [name for name in before if after[name] == before[name]] == ["out/bell/done.json"]
    # the order and the number of workers change no byte
    assert run("fit", *reversed(cases()), "-o", "again", "--workers", 1, "--csv", "lines.csv") == 0
    told = contents("out"), contents("again")
    assert {name: each for name, each in told[0].items() if name != "summary.csv"} == {
        name: each for name, each in told[1].items() if name != "summary.csv"
    }
    assert rows("out") == rows("again")[::-1]


def test_what_fails_is_listed_and_the_rest_goes_on(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("cases", "notes.txt").write_text("no case")
    Path("cases", "bell", "tap1.wav").write_bytes(b"RIFF")
    assert run("fit", *cases(), "cases/absent", "-o", "out", "--workers", 2, "--json") == 1
    told = json.loads(capfd.readouterr().out)
    assert [row["case"] for row in told["cases"]] == ["fork"]
    listed = [json.loads(line) for line in Path("out", "failures.jsonl").read_text().splitlines()]
    assert {one["case"]: one["reason"] for one in listed} == told["failures"]
    assert set(told["failures"]) == {"absent", "bell", "notes.txt"}
    assert "bell/tap1.wav" in told["failures"]["bell"] and "/tmp" not in told["failures"]["bell"]
    assert not any("Traceback" in reason for reason in told["failures"].values())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cases/fork", "cases/bell", "-o", "p.json"], "give a folder for all results"),
        (["nothing", "neither", "-o", "out"], "no case among them"),
        (["cases/fork", "cases/bell", "-o", "out", "--mesh", "m.obj"], "--mesh given beside cases"),
        (["cases/fork", "cases/bell", "-o", "out", "--picture", "a/b.png"], "each case's folder"),
        (["cases/fork", "cases/bell", "-o", "out", "--csv", "result.json"], "each case's folder"),
        (["cases/fork", "other/fork", "-o", "out"], "two cases are named fork"),
    ],
)
def test_what_many_cases_cannot_be_asked_is_one_line(
    place: Path, words: list[str], said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    write_case(Path("other", "fork"), (500.0,))
    assert said in error_of(capfd, "fit", *words)
    assert not Path("out").exists()


def test_a_folder_is_of_one_command_and_its_options(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("fit", *cases(), "-o", "out") == 0
    capfd.readouterr()
    assert "is a run of another command and options" in error_of(capfd, "diagnose", *cases(), "-o", "out")
    words = ("fit", *cases(), "-o", "out", "--dimension-tolerance", "1")
    assert "is a run of another options" in error_of(capfd, *words)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_many_diagnoses_on_a_cluster_whose_workers_die_are_those_of_one_process(place: Path) -> None:
    from distributed import LocalCluster

    for number in range(3):
        write_case(Path("cases", f"more{number}"), (300.0 + 50 * number, 1400.0))
    given = [sys.executable, "-m", "sonic_bullet", "diagnose", *map(str, cases()), "--report", "page.html", "-o"]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
        running = subprocess.Popen([*given, "many", "--scheduler", cluster.scheduler_address])
        until = time.monotonic() + 300
        for wanted in (1, 3):
            while len(stamps("many")) < wanted:
                assert running.poll() is None and time.monotonic() < until
                time.sleep(0.05)
            pids = [worker.pid for worker in cluster.workers.values() if worker.pid]
            if pids:
                os.kill(pids[0], signal.SIGKILL)
        assert running.wait(600) == 0
    assert subprocess.run([*given, "one", "--workers", "1"], check=False).returncode == 0
    assert contents("many") == contents("one") and len(stamps("one")) == 5
    page = Path("one", "bell", "page.html").read_text()
    assert page.startswith("<!")
