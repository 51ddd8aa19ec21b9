"""Commands `compare` and `baseline`: compare two versions of a scene, log or recording; store a version's baseline.

    A, B (or a revision of A) -> Comparison, or one a name of two folders -> words, JSON, one page
    two folders of takes of a thing -> what `states` says of them (states_command.py)

Exit 0: samples equal, or --audible was given and B is within chance; 1: samples differ, or a partner is missing; 2:
wrong use, or a side that cannot be compared; 130: interrupted, and the results so far are printed.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.output import (
    clean_stdout,
    folder_place,
    places,
    print_report,
    quiet_stderr,
    status,
    write_json,
)
from sonic_bullet.options.compare import BaselineOptions, CompareOptions
from sonic_bullet.options.option import given_flags
from sonic_bullet.options.render import DEFAULT_SR
from sonic_bullet.options.states import StatesOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import CompareError, FileError
from sonic_bullet.records.file_endings import SCENE_ENDINGS
from sonic_bullet.records.regular_files import check_regular

if TYPE_CHECKING:
    from sonic_bullet.apps.compare.revision_tree import RevisionTree

OF_SCENES = ("--audible", "--seconds", "--sr", "--client")


def run_compare(a: str, b: str | None, options: CompareOptions) -> None:
    """Run `compare`; raises SonicBulletError."""
    _check(a, b, options.ref, options.report)
    _check_options(a, b, options)
    if b is not None and options.tolerance_db is None and _are_takes(Path(a), Path(b)):
        _compare_takes(a, b, options)
        return
    to, page = places(options.json_to, options.report)
    with clean_stdout(to) as echo, ExitStack() as stack:
        with quiet_stderr():
            import sonic_bullet.apps.compare.compared_sides

            if _of_scenes(a, b):
                import sonic_bullet.scene  # noqa: F401  PyBullet says when it was built
        revision = None
        if options.ref is not None:
            from sonic_bullet.apps.compare.revisions import at_revision

            there, revision = stack.enter_context(at_revision(a, options.ref))
            a, b = there, a
        assert b is not None
        stack.enter_context(status("compare"))
        found, stopped = _compare_pairs(Path(a), Path(b), options, revision, page=page is not None)
        summary = CompareReport(found, stopped)
        print_report(summary, echo)
        if page is not None:
            from sonic_bullet.apps.compare.compare_page import write_page

            write_page(page, [one.kept["page"] for one in found if one.kept is not None])
    write_json(to, summary.to_json())
    if stopped:
        raise KeyboardInterrupt("stopped: what was compared by then is above")
    _exit(found)


def _check(a: str, b: str | None, ref: str | None, report: str | None) -> None:
    """Raise CompareError, FileError for wrong use."""
    if (b is None) == (ref is None):
        raise CompareError("compare needs two things", "give A and B, or A and --ref REV")
    for name in (a, b):
        if name is not None and not Path(name).exists():
            raise CompareError(
                f"there is no {name}", "give a scene (.py .gltf .glb), a contact log (.npz), a recording, a folder"
            )
    if b is not None and Path(a).is_dir() != Path(b).is_dir():
        raise CompareError("one is a folder, the other a file", "give two folders, or two files")
    if report is not None and not report.endswith((".html", ".htm")):
        raise FileError(f"cannot write {report}: a report is a page", "end the name with .html")
    if report is not None and a.lower().endswith(".json"):
        raise CompareError("a baseline holds no sound, so there is no page of it", "leave --report out")


def _are_takes(a: Path, b: Path) -> bool:
    """Tell whether these are folders of takes: recordings alone, none of which states its scale, and not all the same.

    A render's file states its scale: two versions of it are paired by name, to the sample.
    """
    fewest = 2  # one of each is a pair of files
    if not (a.is_dir() and b.is_dir()):
        return False
    from sonic_bullet.apps.compare.folders import pairs_of
    from sonic_bullet.files import read_audio_scale
    from sonic_bullet.records.file_endings import AUDIO_FORMATS

    pairs = pairs_of(a, b)
    sides = [[one[k] for one in pairs if one[k] is not None] for k in (1, 2)]
    files = [Path(one) for side in sides for one in side if one is not None]
    if min(map(len, sides)) < fewest or any(
        one.suffix.lower() not in AUDIO_FORMATS or one.parent not in (a, b) for one in files
    ):
        return False
    same = all(x is not None and y is not None and x.read_bytes() == y.read_bytes() for _, x, y in pairs)
    return not same and all(read_audio_scale(one) is None for one in files)


def _compare_takes(a: str, b: str, options: CompareOptions) -> None:
    """Answer for two folders of takes; exit 1 where anything changed beyond takes, or takes are too few to say."""
    from sonic_bullet.apps.cli.states_command import run_states

    if of_scenes := [flag for flag in given_flags(options) if flag in OF_SCENES]:
        raise CompareError(f"{of_scenes[0]} is for scenes, and these are takes", f"leave {of_scenes[0]} out")
    found = run_states((a, b), StatesOptions(report=options.report, json_to=options.json_to))
    if found is None or any(one.verdict != "none" for one in found.comparisons):
        raise click.exceptions.Exit(1)


def _check_options(a: str, b: str | None, options: CompareOptions) -> None:
    """Raise CompareError for an option that does not apply to the sides."""
    of_scenes = [flag for flag in given_flags(options) if flag in OF_SCENES]
    scenes = _of_scenes(a, b)
    if a.lower().endswith(".json"):
        if not (b or "").lower().endswith(SCENE_ENDINGS):
            raise CompareError(f"{b} is no scene to hold against a baseline", "give a scene (.py) after the baseline")
        if of_scenes:
            raise CompareError(f"a baseline says itself what {of_scenes[0]} would", f"leave {of_scenes[0]} out")
    elif of_scenes and not scenes:
        raise CompareError(f"{of_scenes[0]} is for scenes, and these are none", f"leave {of_scenes[0]} out")


def _of_scenes(a: str, b: str | None) -> bool:
    """Tell whether a side may hold a scene."""
    return a.lower().endswith(SCENE_ENDINGS) or (b or a).lower().endswith(SCENE_ENDINGS) or Path(a).is_dir()


def _compare_pairs(
    a: Path, b: Path, options: CompareOptions, revision: RevisionTree | None, *, page: bool
) -> tuple[list[Any], bool]:
    """Compare all pairs; return one entry a pair, and whether it was interrupted."""
    from sonic_bullet.apps.compare.compared_sides import compare as compare_both
    from sonic_bullet.apps.compare.folders import NamePair, compare_folders
    from sonic_bullet.apps.compare.sides import SceneSide
    from sonic_bullet.apps.compare.tolerance import found_closeness

    def side(path: Path, *, old: bool = False) -> Any:
        if path.suffix.lower() not in SCENE_ENDINGS:
            return path
        sr = options.sr or DEFAULT_SR
        tree = revision if old else None
        return SceneSide(path, seconds=options.seconds, sr=sr, client=options.client, revision=tree)

    def both(one: Path, other: Path) -> dict[str, Any]:
        found, refused = compare_both(side(one, old=True), side(other)), ""
        if options.audible and not found.same and not found.stopped:
            from sonic_bullet.apps.compare.ensemble import audible

            try:
                found = replace(found, audible=audible(found.a, found.b))
            except KeyboardInterrupt:
                found = replace(found, stopped=True)
            except CompareError as error:
                refused = str(error)
        if options.tolerance_db is not None and not found.same:
            found = replace(found, closeness=found_closeness(found.a, found.b, options.tolerance_db))
        return _to_entry(found, page) | {"refused": refused}

    if a.suffix.lower() == ".json":
        return [NamePair(b.name, _against_baseline(a, b, options.tolerance_db))], False
    if a.is_dir():
        return compare_folders(a, b, both)
    kept = both(a, b)
    return [NamePair(b.name, kept)], kept["stopped"]


def _to_entry(found: Any, page: bool) -> dict[str, Any]:
    """Return what is printed and written of a comparison, without its sounds."""
    kept = {"lines": found.lines(), "described": found.to_json(), "passed": found.passed, "stopped": found.stopped}
    if page:
        from sonic_bullet.apps.compare.compare_page import page_entry

        kept["page"] = page_entry(found)
    return kept


def _against_baseline(a: Path, b: Path, tolerance_db: float | None) -> dict[str, Any]:
    """Compare a scene with its baseline."""
    from sonic_bullet.apps.compare.baselines import check_baseline, read_baseline
    from sonic_bullet.apps.compare.tolerance import sameness_words

    checked = check_baseline(read_baseline(a), b, tolerance_db)
    judged = [one.words for one in (checked.audible, checked.closeness) if one is not None]
    words = [*checked.words, *judged, *([f"compared: {checked.compared}"] if checked.passed else [])]
    head = f"differs from {a.name}"
    if checked.same:
        head = "same: all samples are as the baseline's"
    elif checked.passed:
        head = f"{sameness_words(checked.closeness)}: samples differ from those of {a.name}"
    described = {
        "same": checked.same,
        "passed": checked.passed,
        "verdict": head,
        "effects": words,
        "compared": checked.compared,
    }
    return {"lines": [head, *(f"  {one}" for one in words)], "described": described, "passed": checked.passed,
            "stopped": False, "refused": ""}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CompareReport:
    """Report of all pairs, and whether it was interrupted."""

    found: list[Any]
    stopped: bool

    def to_json(self) -> dict[str, Any]:
        """Return each pair's comparison, or why there is none."""
        return {
            "compared": sum(one.kept is not None for one in self.found),
            "stopped": self.stopped,
            "pairs": [
                {"name": one.name, "error": one.error or None, **({} if one.kept is None else one.kept["described"])}
                for one in self.found
            ],
        }

    def lines(self) -> list[str]:
        """Return the lines of each pair, and a count."""
        said = []
        for one in self.found:
            head = f"{one.name}: " if len(self.found) > 1 else ""
            lines = one.kept["lines"] if one.kept is not None else [one.error]
            said += [f"{head}{lines[0]}", *lines[1:]]
        compared = sum(one.kept is not None for one in self.found)
        passed = sum(one.kept is not None and one.kept["passed"] for one in self.found)
        rest = len(self.found) - compared
        tail = f", {rest} not compared" if rest else ""
        end = ", stopped" if self.stopped else ""
        return [*said, f"compared {compared}: {passed} the same, {compared - passed} differ{tail}{end}"]


def _exit(found: list[Any]) -> None:
    """Exit with 1 where samples differ, or raise the error of a pair that could not be compared."""
    for one in found:
        why = one.kept["refused"] if one.kept is not None else "" if one.missing else one.error
        if why:
            raise CompareError(f"{one.name}: {why}")
    if not all(one.kept is not None and one.kept["passed"] for one in found):
        raise click.exceptions.Exit(1)


def run_baseline(scenes: tuple[str, ...], options: BaselineOptions) -> None:
    """Run `baseline`; raises SonicBulletError."""
    for scene in scenes:
        check_regular(scene)
        if not Path(scene).is_file() or not scene.lower().endswith(".py"):
            raise CompareError(f"there is no scene {scene}", "give the paths of scenes (.py)")
    from sonic_bullet.apps.compare.baselines import baseline_place

    to = [
        baseline_place(scene)
        if options.folder is None
        else Path(folder_place(options.folder)) / f"{Path(scene).stem}.json"
        for scene in scenes
    ]
    for place in {one.parent for one in to}:
        folder_place(str(place))
    if len(set(to)) < len(to):
        raise FileError("two scenes have one name", "give each its own -o DIR")
    with quiet_stderr():
        import sonic_bullet.scene  # noqa: F401  PyBullet says when it was built
        from sonic_bullet.apps.compare.baselines import make_baseline, write_baseline
    for scene, place in zip(scenes, to, strict=True):
        with status(scene):
            made = make_baseline(scene, options.reason, options.runs, options.client)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_baseline(str(place), made)
        what = format_count(len(made.features), "run") if made.features else "no ensemble"
        commit = f"commit {made.commit[:12]}{'' if made.clean else ' with changes'}" if made.commit else "no commit"
        print(f"{scene} -> {place}: {what}, {commit}")
