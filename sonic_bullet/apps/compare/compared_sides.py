"""Compare two scenes, logs or recordings: differing inputs, their effects, and which input is the cause.

Side, Side -> inputs that differ (calls of scenes, records of logs) -> substituted -> causes
           -> effects: contacts, modes, sound                                               -> Comparison
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from sonic_bullet.apps.compare.comparison_record import Comparison, Consequence, Difference
from sonic_bullet.apps.compare.inputs.call_pairs import CallPair
from sonic_bullet.apps.compare.inputs.causes import Causes, find_causes, same_sound, shapley_shares
from sonic_bullet.apps.compare.inputs.input_differences import InputDifference, asked_differences
from sonic_bullet.apps.compare.inputs.log_differences import LogDifference, logged_differences
from sonic_bullet.apps.compare.inputs.matched_logs import FirstDifference, first_difference, match_bodies, require_kin
from sonic_bullet.apps.compare.inputs.substitution import Substitution
from sonic_bullet.apps.compare.outcome.modal_effects import modal_effects
from sonic_bullet.apps.compare.outcome.recording_effects import recording_effects
from sonic_bullet.apps.compare.outcome.sound_effects import at_common_rate, sound_effects
from sonic_bullet.apps.compare.revision_tree import find_unpinned, unpinned_words
from sonic_bullet.apps.compare.sides import OtherSound, SceneSide, Side, as_side, run
from sonic_bullet.apps.compare.words import difference_words, logged_words
from sonic_bullet.engine.runtime.replay import render_kept
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import report_progress, show_progress
from sonic_bullet.records.coerce import as_call
from sonic_bullet.records.errors import CompareError
from sonic_bullet.session.scene_file import defines_build

Given = str | Path | SceneSide | ContactLog | Side
CAUSES_FIRST = {True: 0, None: 1, False: 2}


def compare(a: Given, b: Given, *, say: Callable[[str], None] | None = None) -> Comparison:
    """Compare B with A, and name the causes of differences.

    Parameters
    ----------
    a, b
        A scene's file or a `SceneSide`, a contact log or its file, a recording's file. Two scenes, or two logs of equal
        contacts, have causes; other pairs only differences.
    say
        Called with the current task.

    Returns
    -------
    Comparison
        Where the search for causes is interrupted, the result so far (`stopped`).

    Raises
    ------
    SonicBulletError
        A side cannot be run, read or compared.
    """
    with show_progress(as_call(say, "say")):
        report_progress("A")
        one = as_side(a, "a")
        report_progress("B")
        return compare_sides(one, as_side(b, "b"))


def compare_sides(a: Side, b: Side) -> Comparison:
    """Compare two sides that were run or read; raises CompareError."""
    same = a.sr == b.sr and same_sound(a.sound, b.sound)
    if a.log is None or b.log is None:
        effects = () if same else _of_recordings(a, b)
        unrelated = any(one.kind == "unrelated" for one in effects)
        notes = (*(() if unrelated else _notes(a, b)), *_levels(a, b))
        return Comparison(a, b, same, (), effects, notes=notes)
    match = match_bodies(a.log, b.log)
    if not same:
        require_kin(a.log, b.log, match)
    first = FirstDifference(None, None) if same else first_difference(a.log, b.log, match)
    if a.scene is not None and b.scene is not None:
        differences, causes = _of_scenes(a, b, same, first)
    else:
        differences, causes = _of_logs(a.log, b.log, a, b, match, same, first)
    effects = () if same else (*_contact_effect(first), *modal_effects(a.log, b.log, match), *_of_sounds(a, b))
    notes = _notes(a, b)
    if not same and not causes.found and differences and not causes.stopped:
        notes += _why_open(causes, first, a)
    return Comparison(
        a, b, same, tuple(differences), tuple(effects), causes.exact if causes.found else None, None, notes,
        causes.stopped,
    )  # fmt: skip


def _of_scenes(a: Side, b: Side, same: bool, first: FirstDifference) -> tuple[list[Difference], Causes]:
    pairs, asked = asked_differences(a, b)

    def substitute(chosen: Sequence[int], like: Sequence[bytes] | None = None) -> KeptSound:
        report_progress(f"with {', '.join(asked[i].what for i in chosen[:3])} put back")
        return _substitute(b, pairs, [asked[i] for i in chosen], like).sound

    def is_a(chosen: Sequence[int]) -> bool:
        try:
            return same_sound(substitute(chosen, a.frames), a.sound)
        except OtherSound:
            return False

    causes = Causes() if same else find_causes(len(asked), is_a)
    if first.step is None and not same:
        causes = replace(causes, shares=shapley_shares(causes.found, a.sound, b.sound, substitute))
    made = [_difference(*difference_words(a, b, one), one, i, causes, same) for i, one in enumerate(asked)]
    return _in_order(made), causes


def _substitute(
    b: Side, pairs: Sequence[CallPair], asked: Sequence[InputDifference], like: Sequence[bytes] | None
) -> Side:
    """Run B with those inputs of A; like: frames that it must have, else raise OtherSound."""
    assert b.scene is not None
    options = {one.option: one.a for one in asked if one.option}
    if "seconds" in options and not defines_build(Path(b.scene.path)):
        raise CompareError("a plain script says itself how long it runs", "change it there")
    plan = Substitution(pairs, frozenset(place for one in asked for place in one.places))
    return run(replace(b.scene, **options), "b", plan=plan, like=like)


def _of_logs(
    one: ContactLog, other: ContactLog, a: Side, b: Side, match: list[tuple[int | None, int | None]], same: bool,
    first: FirstDifference,
) -> tuple[list[Difference], Causes]:  # fmt: skip
    logged = logged_differences(one, other, match)
    can = [i for i, x in enumerate(logged) if x.exchange is not None]

    def substitute(chosen: Sequence[int]) -> KeptSound:
        made = other
        for i in chosen:
            exchange = logged[can[i]].exchange
            assert exchange is not None
            made = exchange(one, made)
        return render_kept(made)

    causes = Causes()
    if not same and first.step is None:
        causes = find_causes(len(can), lambda chosen: same_sound(substitute(chosen), a.sound))
        shares = shapley_shares(causes.found, a.sound, b.sound, substitute)
        causes = replace(
            causes, found=tuple(can[i] for i in causes.found), shares={can[i]: x for i, x in shares.items()}
        )
    made = [_difference(x.who, logged_words(x), x, i, causes, same) for i, x in enumerate(logged)]
    order = sorted(range(len(made)), key=lambda i: (CAUSES_FIRST[made[i].cause], _rank(logged[i], first), i))
    return [made[i] for i in order], causes


def _rank(one: LogDifference, first: FirstDifference) -> int:
    """Rank an input of a log by how early it can have acted on contacts that differ.

    Bodies that start elsewhere or have other contacts come first, then the engine, then others, then inputs of sound
    alone.
    """
    if first.step is None:
        return 0
    if one.acts == "sound" or one.what == "version":
        return 4
    if one.what.startswith("start") or one.what == "body":
        return 0
    return 1 if one.who in first.bodies or not one.who else 3


def _difference(
    who: str, words: str, one: InputDifference | LogDifference, number: int, causes: Causes, same: bool
) -> Difference:
    cause = True if number in causes.found else False if same or causes.exact else None
    kept = causes.broken.get(number, "") if isinstance(one, InputDifference) else one.note
    return Difference(who, one.what, one.a, one.b, words, cause, causes.shares.get(number), kept)


def _in_order(differences: list[Difference]) -> list[Difference]:
    return sorted(differences, key=lambda one: (CAUSES_FIRST[one.cause], -(one.share or 0)))


def _contact_effect(first: FirstDifference) -> list[Consequence]:
    if first.step is None or first.at_s is None:
        return [Consequence("contacts", "contacts are equal in every step")]
    who = f" of {', '.join(sorted(first.bodies))}" if first.bodies else ""
    words = f"contacts{who} differ from step {first.step} on ({first.at_s * 1e3:.4g} ms)"
    return [Consequence("contacts", words, first.at_s, {"step": first.step})]


def _of_sounds(a: Side, b: Side) -> list[Consequence]:
    one, other, sr = at_common_rate(a.sound.samples(), b.sound.samples(), a.sr, b.sr)
    if not one.size or not other.size:
        return []
    rates = [Consequence("rate", f"rates {a.sr} → {b.sr} Hz: compared at {sr} Hz", 0.0)] if a.sr != b.sr else []
    return rates + sound_effects(one, other, sr)


def _of_recordings(a: Side, b: Side) -> tuple[Consequence, ...]:
    one, other, sr = at_common_rate(a.sound.samples(), b.sound.samples(), a.sr, b.sr)
    effects = _of_sounds(a, b)
    became = recording_effects(one, other, sr)
    head = [x for x in effects if x.kind in ("rate", "length")]
    if any(x.kind == "unrelated" for x in became):
        return (*head, *became)
    return (*head, *became, *(x for x in effects if x not in head))


def _levels(a: Side, b: Side) -> tuple[str, ...]:
    """List the recordings whose level is unknown."""
    return tuple(note for side in (a, b) if side.log is None for note in side.notes)


def _notes(a: Side, b: Side) -> tuple[str, ...]:
    if a.scene is not None and a.scene.revision is not None:
        found = find_unpinned(set(a.read), a.scene.revision, old=True) | find_unpinned(
            set(b.read), a.scene.revision, old=False
        )
        return unpinned_words(found)
    if (a.log is None) != (b.log is None):
        return ("one is a recording: no cause can be named",)
    if a.log is not None and b.log is not None and (a.scene is None) != (b.scene is None):
        return ("one is a log, the other a scene: what a log does not hold cannot be put back",)
    return () if a.log is not None else ("recordings have no inputs: what became of them is described, no cause named",)


def _why_open(causes: Causes, first: FirstDifference, a: Side) -> tuple[str, ...]:
    """Explain why no cause is certain."""
    if a.scene is None:
        return (
            ("contacts differ, and a log cannot be simulated again: share not determinable; compare the scenes",)
            if first.step is not None
            else ("the inputs that can be exchanged do not give A",)
        )
    broken = "; ".join(causes.broken.values())
    return (
        "all inputs that differ put back do not give A: something else differs, such as the scene's own code under "
        f"way, or the scene is not the same twice{f' ({broken})' if broken else ''}",
    )
