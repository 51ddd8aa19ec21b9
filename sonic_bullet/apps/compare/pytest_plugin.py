"""A scene as a test: `sonic_scene("scenes/pour.py")` passes where it sounds as it did.

    def test_pour(sonic_scene):
        sonic_scene("scenes/pour.py")          against scenes/sonic_baselines/pour.json, or --sonic-ref REV

A scene runs in a process of its own: one that ends it fails its test and no other. All other modules are imported when
a test needs them, as pytest loads this one at every start.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PASSED_PROPERTY = "sonic_bullet passed"
"""Property of a test that holds what was compared."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this plugin."""
    group = parser.getgroup("sonic_bullet", "scenes that sound")
    group.addoption("--sonic-ref", metavar="REV", help="hold scenes against this git revision, not against baselines")
    group.addoption("--sonic-update", action="store_true", help="make the baselines of scenes anew")
    group.addoption(
        "--tolerance-db", type=float, metavar="DB", help="octave levels of scenes may differ by so much [samples equal]"
    )
    group.addoption(
        "--sonic-results", metavar="DIR", default="sonic_results", help="where failures leave what they heard"
    )


@pytest.fixture
def sonic_scene(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Provide a function of a scene's path that fails where the scene sounds different than before.

    The path is relative to the test's folder, or else to where pytest was started. tolerance_db: in place of
    --tolerance-db.
    """

    def check(path: str, *, tolerance_db: float | None = None) -> Any:
        __tracebackhide__ = True
        here, config = request.path.parent, request.config
        scene = next((x for x in (here / path, config.rootpath / path) if x.is_file()), None)
        if scene is None:
            pytest.fail(f"there is no scene {path}", pytrace=False)
        results = Path(config.getoption("--sonic-results")) / scene.stem
        allowed = config.getoption("--tolerance-db") if tolerance_db is None else tolerance_db
        said, compared = _in_child(lambda: _check_scene(scene, here, results, config, allowed))
        if said:
            pytest.fail(said, pytrace=False)
        request.node.user_properties.append((PASSED_PROPERTY, f"{path}: {compared}"))

    return check


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """List what was compared in tests that passed."""
    passed = terminalreporter.stats.get("passed", [])
    lines = [value for one in passed for name, value in one.user_properties if name == PASSED_PROPERTY]
    if lines:
        terminalreporter.section("scenes that sound as they did")
        for line in lines:
            terminalreporter.line(line)


def _in_child(check: Callable[[], tuple[str, str]]) -> tuple[str, str]:
    """Call ``check`` in a child process, which a scene may end; return its result."""
    from sonic_bullet.files.storage.json_text import json_bytes
    from sonic_bullet.machine.leftovers import temporary_folder
    from sonic_bullet.machine.supervisor import run_supervised
    from sonic_bullet.records.errors import SonicBulletError

    with temporary_folder() as folder:
        answer = folder / "answer.json"

        def run() -> int:
            try:
                found = check()
            except SonicBulletError as error:
                found = str(error), ""
            except Exception as error:
                found = f"{type(error).__name__}: {error}", ""
            answer.write_bytes(json_bytes(found))
            return 0

        ending = run_supervised(run, alone=False)
        if not answer.is_file():
            return ending.words or "the scene's process ended without a result", ""
        said, compared = json.loads(answer.read_text(encoding="utf-8"))
        return said, compared


def _check_scene(
    scene: Path, here: Path, results: Path, config: pytest.Config, tolerance_db: float | None
) -> tuple[str, str]:
    """Check a scene; return the failure with its explanation ("": none), and what was compared."""
    ref = config.getoption("--sonic-ref")
    if ref is not None:
        return _against(scene, ref, [], results, tolerance_db)
    from sonic_bullet.apps.compare.baselines import (
        BASELINE_FOLDER,
        baseline_place,
        check_baseline,
        make_baseline,
        read_baseline,
        write_baseline,
    )

    baseline = baseline_place(scene)
    with_test = here / BASELINE_FOLDER / baseline.name
    if not baseline.is_file() and with_test.is_file():  # put there by `baseline -o`
        baseline = with_test
    if config.getoption("--sonic-update"):
        made = make_baseline(scene, "pytest --sonic-update")
        baseline.parent.mkdir(exist_ok=True)
        write_baseline(baseline, made)
        return "", f"baseline made anew, {baseline}"
    if not baseline.is_file():
        return f"{scene.name} has no baseline; make it: sonic-bullet baseline {scene} --reason WHY", ""
    known = read_baseline(baseline)
    checked = check_baseline(known, scene, tolerance_db)
    if checked.passed:
        return "", checked.compared
    said = [f"{scene.name} sounds otherwise than its baseline ({known.reason}): {'; '.join(checked.words)}"]
    said += [one.words for one in (checked.audible, checked.closeness) if one is not None]
    if not known.commit or not known.clean:
        return "\n".join([*said, "the baseline was made of files in no commit: no cause can be named"]), ""
    return _against(scene, known.commit, said, results, None)


def _against(scene: Path, ref: str, said: list[str], results: Path, tolerance_db: float | None) -> tuple[str, str]:
    """Name the cause of a failure from the scene at a revision; "": there is no failure and no difference."""
    from dataclasses import replace

    from sonic_bullet.apps.compare.compared_sides import compare
    from sonic_bullet.apps.compare.failure_folder import write_failure
    from sonic_bullet.apps.compare.revisions import at_revision
    from sonic_bullet.apps.compare.sides import SceneSide
    from sonic_bullet.apps.compare.tolerance import found_closeness
    from sonic_bullet.records.errors import CompareError

    try:
        with at_revision(str(scene), ref) as (before, revision):
            found = compare(SceneSide(before, revision=revision), scene)
            if tolerance_db is not None and not found.same:
                found = replace(found, closeness=found_closeness(found.a, found.b, tolerance_db))
            if not found.passed:
                write_failure(results, found)
                return "\n".join([*found.lines(), *said, f"what was heard: {results}"]), ""
            if said:
                return "\n".join([*said, f"the scene at {ref[:12]} sounds the same here"]), ""
            return "", "; ".join([found.compared, *found.notes])
    except CompareError as error:
        if not said:
            raise
        return "\n".join([*said, f"no cause can be named: {error}"]), ""
