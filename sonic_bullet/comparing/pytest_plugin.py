"""A scene as a test: `sonic_scene("scenes/pour.py")` passes where it sounds as it did.

    def test_pour(sonic_scene):
        sonic_scene("scenes/pour.py")          against sonic_baselines/pour.json beside the test, or --sonic-ref REV

Everything else is imported when a test asks for it: pytest loads this module at every start, whatever it tests.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

FOLDER = "sonic_baselines"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of this plugin."""
    group = parser.getgroup("sonic_bullet", "scenes that sound")
    group.addoption("--sonic-ref", metavar="REV", help="hold scenes against this git revision, not against baselines")
    group.addoption("--sonic-update", action="store_true", help="make the baselines of scenes anew")
    group.addoption(
        "--sonic-results", metavar="DIR", default="sonic_results", help="where failures leave what they heard"
    )


@pytest.fixture
def sonic_scene(request: pytest.FixtureRequest) -> Callable[[str], Any]:
    """A function of a scene's path that fails where the scene sounds otherwise than it did.

    The path counts from the test's own folder, or else from where pytest was started.
    """

    def check(path: str) -> Any:
        __tracebackhide__ = True
        from sonic_bullet.records.errors import SonicBulletError

        here = request.path.parent
        scene = next((x for x in (here / path, request.config.rootpath / path) if x.is_file()), None)
        if scene is None:
            pytest.fail(f"there is no scene {path}", pytrace=False)
        results = Path(request.config.getoption("--sonic-results")) / scene.stem
        try:
            said = _checked(scene, here / FOLDER / f"{scene.stem}.json", results, request.config)
        except SonicBulletError as error:
            said = str(error)
        if said:
            pytest.fail(said, pytrace=False)

    return check


def _quiet(text: str) -> None:
    pass


def _checked(scene: Path, baseline: Path, results: Path, config: pytest.Config) -> str:
    """What is wrong, in one line and those that explain it; "": nothing."""
    ref = config.getoption("--sonic-ref")
    if ref is not None:
        return _against(scene, ref, [], results)
    from sonic_bullet.comparing.baselines import check_baseline, make_baseline, read_baseline, write_baseline

    if config.getoption("--sonic-update"):
        baseline.parent.mkdir(exist_ok=True)
        write_baseline(baseline, make_baseline(scene, "pytest --sonic-update", _quiet))
        return ""
    if not baseline.is_file():
        command = f"sonic-bullet baseline {scene} -o {baseline.parent} --reason WHY"
        return f"{scene.name} has no baseline; make it: {command}"
    known = read_baseline(baseline)
    checked = check_baseline(known, scene, _quiet)
    if checked.passed:
        return ""
    said = [f"{scene.name} sounds otherwise than its baseline ({known.reason}): {'; '.join(checked.words)}"]
    if checked.audible is not None:
        said.append(checked.audible.words)
    if not known.commit or not known.clean:
        return "\n".join([*said, "the baseline was made of files in no commit: no cause can be named"])
    return _against(scene, known.commit, said, results)


def _against(scene: Path, ref: str, said: list[str], results: Path) -> str:
    """The cause of what was said, from the scene as it was at a revision; "": nothing was said and nothing differs."""
    from sonic_bullet.comparing.compared_sides import compare
    from sonic_bullet.comparing.failure_folder import write_failure
    from sonic_bullet.comparing.revisions import at_revision
    from sonic_bullet.records.errors import CompareError

    try:
        with at_revision(str(scene), ref) as before:
            found = compare(before, scene)
            if not found.passed:
                write_failure(results, found)
                return "\n".join([*found.lines(), *said, f"what was heard: {results}"])
            return "\n".join([*said, f"the scene at {ref[:12]} sounds the same here"] if said else [])
    except CompareError as error:
        if not said:
            raise
        return "\n".join([*said, f"no cause can be named: {error}"])
