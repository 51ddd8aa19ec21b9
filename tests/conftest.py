"""Where tests find data that stands beside the project, and a world to listen to."""

from __future__ import annotations

import gc
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

REPO = Path(__file__).resolve().parents[1]
JOURNEYS = REPO / "tests" / "journeys"
SIGNALS = {word: signal.getsignal(word) for word in (signal.SIGINT, signal.SIGTERM)}
os.environ.setdefault("SONIC_BULLET_PROGRESS", "0")  # lines that hang on how fast a machine is; see test_progress_*


def find_shared() -> Path | None:
    """The folder of shared data: SONIC_BULLET_SHARED, or ``shared`` beside the project."""
    for place in (os.environ.get("SONIC_BULLET_SHARED"), REPO.parent / "shared"):
        if place and (Path(place) / "practice").is_dir():
            return Path(place)
    return None


@pytest.fixture(scope="session")
def shared_path() -> Path:
    place = find_shared()
    if place is None:
        pytest.skip("shared data not found: set SONIC_BULLET_SHARED")
    return place


@pytest.fixture(autouse=True)
def commands_run_here(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Commands called in a test's own process run there, where stubs are seen, and leave its signals as they were, as
    do those of a module's fixtures, which are called before; processes that tests start supervise.
    """
    monkeypatch.setattr("sonic_bullet.machine.supervisor.ASK_WHERE", None)
    monkeypatch.setattr("sonic_bullet.files.storage.user_folder.notes", [])  # a command prints what another test left
    put_back_signals()
    yield
    put_back_signals()


def put_back_signals() -> None:
    for word, handler in SIGNALS.items():
        signal.signal(word, handler)


@pytest.fixture
def client() -> Iterator[Any]:
    """A PyBullet world of its own with gravity."""
    from sonic_bullet.simulators import direct_client, disconnect

    made = direct_client()
    made.setGravity(0, 0, -9.81)
    yield made
    disconnect(made)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--processor-times", type=int, default=0, metavar="N",
        help="name the N tests and the N files that took most processor time, whatever else the machine did",
    )  # fmt: skip


STARTED_S = pytest.StashKey[float]()


def used_s() -> float:
    """Processor time of this process and of those that it started and that have ended."""
    return sum(os.times()[:4])


def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[STARTED_S] = used_s()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """Note with the last report of a test what it took, its fixtures included: it goes from worker to terminal so."""
    report = yield
    if call.when == "teardown" and STARTED_S in item.stash:
        report.user_properties.append(("processor_s", used_s() - item.stash[STARTED_S]))
    return report


def write_times(terminalreporter: pytest.TerminalReporter, most: int) -> None:
    tests: dict[str, float] = {}
    for report in (one for some in terminalreporter.stats.values() for one in some):
        if (used := dict(getattr(report, "user_properties", ())).get("processor_s")) is not None:
            tests[report.nodeid] = used
    files: dict[str, float] = {}
    for name, used in tests.items():
        files[name.split("::")[0]] = files.get(name.split("::")[0], 0.0) + used
    for times in (tests, files):
        terminalreporter.write_line(f"{sum(times.values()):.0f} s of processor in {len(times)}:")
        for name in sorted(times, key=lambda one: -times[one])[:most]:
            terminalreporter.write_line(f"{times[name]:8.2f} s  {name}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the ways of use first: what a user meets is seen to be broken before anything else is."""
    items.sort(key=lambda item: JOURNEYS not in item.path.parents)


def pytest_collection_finish() -> None:
    """Take what collection made for permanent: tests that collect garbage would walk it each time, half a second."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say how many tests did not happen, and for want of what: a comparison that silently did not run is a defect."""
    if most := config.getoption("--processor-times"):
        write_times(terminalreporter, most)
    skipped = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    for what, said in (
        ("shared data", "shared data not found"),
        ("another library", "could not import"),
        ("a Chromium", "no Chromium on PATH"),
        ("Blender's bpy", "no bpy"),
        ("a Blender with a window", "no Blender with a window"),
        ("a disk of one's own", "no mount namespace"),
    ):
        of = [one for one in skipped if said in one]
        names = sorted({name for one in of for name in re.findall(said + r" '?(\w+)", one)})
        of_what = f": {', '.join(names)}" if names else ""
        terminalreporter.write_line(f"{len(of)} tests skipped for want of {what}{of_what}")
