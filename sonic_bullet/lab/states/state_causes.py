"""Which physics makes what moved: effects that exist, applied to the first state as it was recorded.

    certain changes -> shifts of lines, T60, levels, noise -> the effects that make such a pattern, and no other
    spectrum_shift -> are its modes what they were, times one factor, or others?  contact_pulses -> one law of levels?

Two that make the same pattern are one class, with what would tell them apart. Levels alone are no change of the thing:
another place or strength of the strike, another place of the microphone or another chain make them, too. What is named
where the modes are not shown to be what they were is not told from other modes, which any pattern may come of.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import comb

import numpy as np

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.states.chance import CERTAIN
from sonic_bullet.lab.states.changes import GONE_DB, Changes, StateChange
from sonic_bullet.lab.states.contact_pulses import ContactPair, fit_contacts
from sonic_bullet.lab.states.spectrum_shift import NEAREST
from sonic_bullet.lab.states.take_lines import MOST_PAIRED_LINES, SharedLines
from sonic_bullet.records import Array

SHIFT_PERCENT = 0.1
"""Of a line's frequency: less is what a degree does to plastics, ten to metals, and neighbours to others' lines."""
RATIO = 1.15
"""Of T60: less is what another mixture of the same lines does to an octave."""
MOST = 0.8
"""Share of what moved that must have moved one way for a name that says which way."""
LEVEL_DB = 2.0
FAINT_DB = 25.0
"""Below the loudest: octaves and lines that are no one's."""
OTHER_MODES, STRIKE_PLACE = "other-modes", "strike-place"
MAKERS_OF_MODES = ("wall-thickness", "material", "size")
"""What gives a thing other modes than it had, by factors of their own or by one that is not seen."""
SEPARATES_MODES = "several places struck in each state, for other places excite other lines of the same ones; its mass"
FEWEST_LOSSES = 3
"""Lines whose losses tell a material: of two, one is a neighbour's too often."""


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect by name, with all that these data cannot tell it from, and what would.

    of_the_thing: whether the thing changed, not how it was struck or recorded. numbers: what was fitted, with
    units in their names. explains: how many of the certain changes.
    """

    name: str
    alternatives: tuple[str, ...]
    of_the_thing: bool
    words: str
    separated_by: str = ""
    numbers: dict[str, float] = field(default_factory=dict)
    explains: int = 0


def find_causes(found: Changes, *, same_strikes: bool = False) -> tuple[Cause, ...]:
    """Name what makes the certain changes; empty where nothing does.

    same_strikes: both states are recordings of the same strikes, so that the body cannot differ.
    """
    if not found.anything:
        return ()
    if same_strikes:
        return (_listener(found),)
    for alone in (_whole_spectrum, _contact, _other_modes):
        cause = alone(found)
        if cause is not None:
            return (cause,)
    causes = [one for one in (_frequency(found), _decay(found), _noise(found)) if one is not None]
    for otherwise in (_echoes, _added_lines, _levels, _other_modes_or_place, _lost_lines):
        causes = causes or [one for one in (otherwise(found),) if one is not None]
    return tuple(_with_other_modes(one) for one in causes) if _may_have_other_modes(found) else tuple(causes)


def _may_have_other_modes(found: Changes) -> bool:
    """Whether what is loud is not shown to be where it was."""
    return found.shift is not None and found.shift.stay_chance > CERTAIN


def _with_other_modes(cause: Cause) -> Cause:
    """Return a cause that is not told from other modes: those that it may come of beside it."""
    more = tuple(one for one in MAKERS_OF_MODES if one not in (cause.name, *cause.alternatives))
    if not more:
        return cause
    return replace(
        cause, alternatives=cause.alternatives + more, separated_by=f"{cause.separated_by}; {SEPARATES_MODES}"
    )


def _other_modes(found: Changes) -> Cause | None:
    """Name other modes: what is loud lies elsewhere. Lines that were exchanged tell them from others of the same."""
    if found.shift is None or found.shift.moved(CERTAIN):
        return None
    exchanged = _exchanged_lines(found) <= CERTAIN
    if not exchanged and not found.shift.left:
        return None
    return _name_other_modes(found, exchanged=exchanged)


def _name_other_modes(found: Changes, *, exchanged: bool) -> Cause:
    return Cause(
        OTHER_MODES,
        MAKERS_OF_MODES if exchanged else (*MAKERS_OF_MODES, STRIKE_PLACE),
        exchanged,
        "what is loud in one state is not in the other, and no one factor pairs them: other modes, as another wall, "
        f"material or shape has them{'' if exchanged else ', or another place of the strike, which excites others'}",
        "its mass and dimensions in both states" if exchanged else SEPARATES_MODES,
        {} if found.shift is None else {"unmoved": found.shift.unmoved},
        sum(row.certain for row in found.rows),
    )


def _other_modes_or_place(found: Changes) -> Cause | None:
    """Name the class of what is not shown to have left anything loud where it was."""
    fewest = 3  # lines of either state: with fewer there is nothing that could be elsewhere
    lines = [one.lines.freq_hz for one in (found.before, found.after)]
    if not _may_have_other_modes(found) or min(map(len, lines)) < fewest or not found.of("line level"):
        return None
    return _name_other_modes(found, exchanged=False)


def _exchanged_lines(found: Changes) -> float:
    """Return the chance that another place takes so many of the loud lines away and brings so many.

    Each with one in six (GONE_DB), but for those that moved; 1 where lines only went or only came, which a striker,
    damping or noise do, too, and of so many lines that only the strongest were taken, which elsewhere are no longer so.
    """
    if max(len(one.lines.freq_hz) for one in (found.before, found.after)) >= MOST_PAIRED_LINES:
        return 1.0
    rows = found.of("line level", certain=False)
    went, came = gone_and_come(found)
    counts = []
    for gone, level in ((went, [row.before for row in rows]), (came, [row.after for row in rows])):
        loud = [row for row, one in zip(rows, level, strict=True) if one > max(level) - FAINT_DB]
        counts.append((len(loud), sum(row in gone for row in loud)))
    if not all(gone for _, gone in counts):
        return 1.0
    n, k = (sum(one) for one in zip(*counts, strict=True))
    return float(sum(comb(n, j) * 5 ** (n - j) for j in range(k, n + 1)) / 6**n)


def _contact(found: Changes) -> Cause | None:
    """Name another contact where lines are as they were, but for levels that go as two contacts' spectra do."""
    if found.shift is None or not found.shift.stayed(CERTAIN) or not _lines_untouched(found):
        return None
    fit = fit_contacts(found)
    if not fit.explains or fit.chance > CERTAIN:
        return None
    return _name_contact(found, fit, {})


def _name_contact(found: Changes, fit: ContactPair, numbers: dict[str, float]) -> Cause:
    return Cause(
        ContactTime.id,
        (MeasurementChain.id, "striker", STRIKE_PLACE),
        False,
        f"levels differ as a {'longer' if fit.after_s > fit.before_s else 'shorter'} contact makes them, "
        f"{1000 * fit.before_s:.2g} to {1000 * fit.after_s:.2g} ms, all lines alike",
        "the striker's force, or a recording of the same sound by both chains",
        numbers | {"contact_before_s": fit.before_s, "contact_after_s": fit.after_s, "off_db": fit.off_db},
        len(found.of("line level")) + len(found.of("octave level")),
    )


def _whole_spectrum(found: Changes) -> Cause | None:
    """Name what moves the whole spectrum by one factor: size or stiffness over mass, or with its loss the material.

    Of one material T60 f stays, but for what takes from outside, as fingers: d = c/m and m ~ s³, f ~ 1/s make it go as
    f^-2; stiffness alone makes it go as f.
    """
    if found.shift is None:
        return None
    if found.shift.moved(CERTAIN):
        log_factor = found.shift.log_factor
    elif found.pairs.stretch and found.of("moved line"):  # less than the spectrum tells: lines do
        log_factor = found.pairs.stretch
    else:
        return None
    factor = float(np.exp(log_factor))
    ratio, spread, count = _loss_ratio(found.before.lines, found.after.lines, log_factor)
    numbers = {"frequency_factor": factor, "agreement": found.shift.agreement, "lines_compared": float(count)}
    percent = 100 * (factor - 1)
    went = f"the whole spectrum went {'up' if factor > 1 else 'down'} by one factor, {percent:+.3g} %"
    changed = sum(row.certain for row in found.rows)
    if count >= FEWEST_LOSSES:
        numbers |= {"loss_factor_ratio": 1 / ratio, "loss_factor_ratio_spread": spread / ratio}
        low, high = min(1.0, factor**-2, factor), max(1.0, factor**-2, factor)
        off = max(np.log(low / ratio), np.log(ratio / high))
        if off > max(_student(count) * spread, np.log(RATIO)):
            return Cause(
                "material",
                ("size-and-damping",),
                True,
                f"{went}, and its lines lose {1 / ratio:.2g} times as much a cycle: another material",
                "its mass and dimensions in both states, weighed and measured",
                numbers,
                changed,
            )
    return Cause(
        "stiffness",
        ("size", "wall-thickness", "mass", "material"),
        True,
        f"{went}: size, or stiffness over mass (of a plate its thickness, too)",
        "its mass and dimensions in both states, weighed and measured",
        numbers,
        changed,
    )


def _student(count: int) -> float:
    """Return how many spreads, known from so many values, chance exceeds either way in CERTAIN of all."""
    from scipy.stats import t

    return float(t.isf(CERTAIN / 2, count - 1))


def _loss_ratio(a: SharedLines, b: SharedLines, log_factor: float) -> tuple[float, float, int]:
    """Median ratio of T60 f of lines that one factor pairs, the spread of its logarithm, and how many they are.

    The spectrum knows the factor to NEAREST; within that, strong lines that agree tell it as finely as they are known.
    """
    near, step, loud_db = 0.003, 0.0005, 30.0  # below the loudest there are a room's lines
    first, second = (np.flatnonzero(one.level_db > one.level_db.max(initial=-np.inf) - loud_db) for one in (a, b))
    if not len(first) or not len(second):
        return 1.0, np.inf, 0
    away = np.log(b.freq_hz[second])[None] - np.log(a.freq_hz[first])[:, None] - log_factor
    strength = [10 ** ((one.level_db[at] - one.level_db.max()) / 40) for one, at in ((a, first), (b, second))]
    tried = np.arange(-NEAREST, NEAREST + step / 2, step)
    agreeing = np.exp(-2 * ((away - tried[:, None, None]) / near) ** 2) * np.outer(*strength)
    away = np.abs(away - tried[agreeing.max(axis=2).sum(axis=1).argmax()])
    partner, back = away.argmin(axis=1), away.argmin(axis=0)
    pairs = [(i, j) for i, j in enumerate(partner) if back[j] == i and away[i, j] < near]
    if not pairs:
        return 1.0, np.inf, 0
    i, j = first[[one for one, _ in pairs]], second[[other for _, other in pairs]]
    ratio = np.log(b.freq_hz[j] / b.decay_per_s[j]) - np.log(a.freq_hz[i] / a.decay_per_s[i])
    middle = float(np.median(ratio))
    normal = 1.4826 * np.sqrt(np.pi / 2)  # from the median of departures to the spread of a median of normal values
    spread = float(normal * np.median(np.abs(ratio - middle)) / np.sqrt(len(ratio)))
    return float(np.exp(middle)), spread, len(ratio)


def _echoes(found: Changes) -> Cause | None:
    """Name a room whose echoes differ: what is loud stays where it is, and every line is pulled a little, either way.

    Echoes beside a line add to it in any phase, so that they raise and lower its frequency and its T60 alike.
    """
    fewest, share = 5, 0.5  # lines that both states hold, and of these that must have been pulled: echoes are in all
    if found.shift is None or not found.shift.stayed(CERTAIN):
        return None
    compared = {row.freq_hz for row in found.of("line T60", certain=False)}
    pulled = [row for row in found.of("line frequency") if abs(row.change) < 1.0]
    rung = found.of("line T60")
    touched = {row.freq_hz for row in pulled + rung}
    late = [row for kind in ("octave T60", "octave late T60", "octave attack") for row in found.of(kind)]
    if len(compared) < fewest or len(touched) < share * len(compared) or len({row.freq_hz for row in late}) < 2:
        return None
    for signs in ([row.change > 0 for row in pulled], [row.change > 1 for row in rung]):
        if not signs or not 1 - MOST < np.mean(signs) < MOST:
            return None
    count = len(late) + len(pulled) + len(rung)
    return _name_echoes(len(touched), len(compared), count)


def _name_echoes(pulled: int, compared: int, explains: int) -> Cause:
    return Cause(
        Room.id,
        ("microphone-place", MeasurementChain.id, SupportDamping.id),
        False,
        f"what is loud stays where it was, and {pulled} of {compared} lines are pulled either way, as "
        "echoes beside them do: another room, or the microphone elsewhere in it; or other supports instead of those",
        "the same strike recorded by both microphones at once",
        {"lines_pulled": float(pulled), "lines_compared": float(compared)},
        explains,
    )


def shifts(found: Changes) -> list[StateChange]:
    """Return the lines whose frequency moved by more than neighbours and a few degrees move it."""
    rows = found.of("moved line") + found.of("line frequency")
    kept = [row for row in rows if abs(row.change) > max(SHIFT_PERCENT, 0.5 * _width_percent(found, row.freq_hz))]
    return sorted(kept, key=lambda row: row.freq_hz)


def _width_percent(found: Changes, freq_hz: float) -> float:
    """Width of a line in % of its frequency, d/ω."""
    if not len(found.pole):
        return 0.0
    k = int(np.abs(found.pole.imag / (2 * np.pi) - freq_hz).argmin())
    return float(100 * -found.pole[k].real / found.pole[k].imag)


def _find_unmoved(found: Changes, moved: list[StateChange]) -> list[StateChange]:
    """Return lines that both states hold and that can only have moved by far less than those that moved."""
    gone = {x for row in moved for x in (row.freq_hz, row.before, row.after)}
    far = float(np.median([abs(row.change) for row in moved]))
    level = {row.freq_hz: row for row in found.of("line level", certain=False)}
    return [
        row
        for row in found.of("line frequency", certain=False)
        if max(abs(row.low), abs(row.high)) < 0.25 * far
        and not any(abs(row.freq_hz / x - 1) < 3e-3 for x in gone)
        and abs(level[row.freq_hz].change) < GONE_DB
    ]


def gone_and_come(found: Changes) -> tuple[list[StateChange], list[StateChange]]:
    """Return the lines that went and those that came, without pairs of one that moved."""
    moved = [x for row in found.of("moved line") for x in (row.before, row.after)]
    rows = [row for row in found.of("line level") if not any(abs(row.freq_hz / f - 1) < 3e-3 for f in moved)]
    return [row for row in rows if row.change < -GONE_DB], [row for row in rows if row.change > GONE_DB]


def _frequency(found: Changes) -> Cause | None:  # noqa: PLR0911
    alone_percent = 1.0  # a single line, or few of many, must have gone farther than neighbours push each other
    moved = shifts(found)
    if not moved:
        return None
    still = _find_unmoved(found, moved)
    change = np.array([row.change for row in moved])
    went, came = gone_and_come(found)
    few = len(moved) < 2 or len(moved) < 0.25 * (len(moved) + len(still))
    if few and np.abs(change).max() < alone_percent:
        return None
    if len(moved) < (len(went) + len(came)) / 2 or (len(moved) == 1 and len(went) + len(came) > 1):
        return None  # lines that went and came all over: their neighbours make pairs by chance
    down = float((change < 0).mean())
    middle = float(np.median(change))
    common = 100 * float(np.expm1(found.pairs.stretch)) if found.pairs.stretch else middle
    agreeing = float((np.abs(change - common) < 0.1 * abs(common)).mean())
    alike = len(moved) >= 3 and agreeing >= (0.5 if found.pairs.stretch else MOST) and len(still) < len(moved) / 2
    numbers = {
        "largest_shift_percent": float(change[np.abs(change).argmax()]),
        "median_shift_percent": middle,
        "lines_moved": float(len(moved)),
        "lines_still": float(len(still)),
    }
    count = len(moved)
    if alike:
        direction = "up" if middle > 0 else "down"
        return Cause(
            "stiffness",
            ("size", "mass", "temperature") if middle < 0 else ("tension", "size", "temperature"),
            True,
            f"all lines went {direction} by one factor, {middle:+.3g} %: stiffness or tension over mass, or size",
            "its mass and dimensions in both states, weighed and measured",
            numbers,
            count,
        )
    if down >= MOST:
        return Cause(
            AddedMass.id,
            ("lost-stiffness",),
            True,
            f"{count} lines went down, by up to {numbers['largest_shift_percent']:.3g} %, {len(still)} stayed: mass",
            "its mass in both states; a crack or a notch also shortens T60 of the lines that it moves",
            numbers,
            count,
        )
    if down <= 1 - MOST:
        return Cause(
            "added-stiffness",
            ("removed-mass",),
            True,
            f"{count} lines went up, by up to {numbers['largest_shift_percent']:.3g} %, {len(still)} did not move: "
            "stiffness, or mass taken off",
            "its mass in both states",
            numbers,
            count,
        )
    return None


def decays(found: Changes) -> list[StateChange]:
    """Return the T60 that changed: of lines, and of octaves where lines do not say otherwise."""
    lines = [row for row in found.of("line T60") if abs(np.log(row.change)) > np.log(RATIO)]
    steady = [
        row
        for row in found.of("line T60", certain=False)
        if row not in lines and max(abs(np.log(row.low)), abs(np.log(row.high))) < 2 * np.log(RATIO)
    ]
    kept = list(lines)
    rows = [
        row for row in found.of("octave T60") + found.of("octave late T60") if abs(np.log(row.change)) > np.log(RATIO)
    ]
    for row in rows:
        if row.freq_hz in quiet_octaves(found):
            continue
        inside = [one for one in steady if abs(np.log2(one.freq_hz / row.freq_hz)) < 0.5]
        agreeing = [
            one
            for one in lines
            if abs(np.log2(one.freq_hz / row.freq_hz)) < 0.5 and (one.change > 1) == (row.change > 1)
        ]
        adjacent = [
            one
            for one in rows
            if one is not row
            and abs(np.log2(one.freq_hz / row.freq_hz)) <= 1.0
            and (one.change > 1) == (row.change > 1)
        ]
        if len(agreeing) > len(inside) or (not inside and (adjacent or _broadened(found, row))):
            kept.append(row)
    return kept


def _broadened(found: Changes, decay: StateChange) -> bool:
    """Whether the lines of a decay's octave are broader where it is shorter, narrower where it is longer."""
    return any(
        abs(np.log2(one.freq_hz / decay.freq_hz)) <= 0.5 and (one.change < 0) == (decay.change > 1)
        for one in found.of("octave flatness")
    )


def quiet_octaves(found: Changes, below_db: float = FAINT_DB) -> set[float]:
    """Return the octaves that are far below the loudest in either state: what rings there is no one's decay."""
    rows = found.of("octave level", certain=False)
    loudest = [max((row.before for row in rows), default=0.0), max((row.after for row in rows), default=0.0)]
    return {row.freq_hz for row in rows if min(row.before - loudest[0], row.after - loudest[1]) < -below_db}


def _decay(found: Changes) -> Cause | None:
    fewest = 2
    least_share = (
        0.5  # of the T60 compared between the lowest and the highest that changed: one line's is its neighbour's
    )
    changed = decays(found)
    tail = _tail(found)
    if tail is not None:
        return tail
    # of a thing whose lines are elsewhere breadth tells nothing
    same = found.shift is None or found.shift.stayed(CERTAIN)
    told = len(changed) + (sum(_broadened(found, row) for row in changed) if same else 0)
    if told < (fewest if not shifts(found) else 2 * fewest):
        return None
    low, high = (pick(row.freq_hz for row in changed) for pick in (min, max))
    compared = [
        row
        for row in found.of("line T60", certain=False) + found.of("octave T60", certain=False)
        if low <= row.freq_hz <= high and row.freq_hz not in quiet_octaves(found)
    ]
    if len(changed) < least_share * len(compared):
        return None
    ratio = np.array([row.change for row in changed])
    shorter = float((ratio < 1).mean())
    if 1 - MOST < shorter < MOST:
        return None
    numbers = _law(found, changed)
    where = f"{ratio.min():.2g} to {ratio.max():.2g}"
    if shorter < 0.5:
        return Cause(
            "less-damping",
            (DampingLaw.id, SupportDamping.id, Room.id),
            True,
            f"T60 longer, by {where}: less damping, or a room's tail",
            "the same strike recorded near and far at once",
            numbers,
            len(changed),
        )
    return Cause(
        "damping",
        (DampingLaw.id, SupportDamping.id),
        True,
        f"T60 shorter, by {where}: damping added{_law_words(numbers)}",
        "strikes at several places: a dashpot at a place spares the modes that have a node there",
        numbers,
        len(changed),
    )


def _tail(found: Changes) -> Cause | None:
    """Name a room: octaves that ring longer, all of them, and more like noise or all alike; or less.

    A room has one late decay in every band, whatever the body's [Kuttruff 2009, ch. 4].
    """
    fewest = 2  # bands: a line or two of one change both of its decays
    octaves = [
        row for row in found.of("octave T60") + found.of("octave late T60") if abs(np.log(row.change)) > np.log(RATIO)
    ]
    if _lines_untouched(found):
        return None
    for direction in (1, -1):
        longer = [row for row in octaves if direction * np.log(row.change) > 0]
        bands = {row.freq_hz for row in longer}
        if len(longer) < MOST * len(octaves) or len(bands) < fewest or _louder(found, direction):
            continue
        if not (_noisier(found, direction) or _one_decay(longer, direction) or _beneath(found, longer, direction)):
            continue
        ratio = [row.change for row in longer]
        return Cause(
            Room.id,
            ("microphone-place", MeasurementChain.id, "less-damping" if direction > 0 else "damping"),
            False,
            f"T60 {'longer' if direction > 0 else 'shorter'}, by {min(ratio):.2g} to {max(ratio):.2g}, as a room "
            f"makes it {'in' if direction > 0 else 'out of'} every band",
            "the same strike recorded by both microphones at once",
            {"t60_ratio_most": max(ratio), "t60_longest_s": max(max(row.before, row.after) for row in longer)},
            len(longer),
        )
    return None


def _lines_untouched(found: Changes) -> bool:
    """Whether lines that both states hold ring on as they did: a room adds echoes of its own to every one."""
    fewest, most = 10, 0.1
    compared = found.of("line T60", certain=False)
    touched = {row.freq_hz for row in found.of("line T60") + found.of("line frequency")}
    return len(compared) >= fewest and len(touched) <= most * len(compared)


def _noisier(found: Changes, direction: int) -> bool:
    """Whether octaves are more like noise, all that changed in that."""
    flatter_db, fewest = 3.0, 2
    flatness = [row for row in found.of("octave flatness") if abs(row.change) > flatter_db]
    noisier = [row for row in flatness if direction * row.change > 0]
    return len(noisier) >= max(fewest, MOST * len(flatness))


def _beneath(found: Changes, longer: list[StateChange], direction: int) -> bool:
    """Whether only quiet octaves ring longer, that of themselves rang shorter than the tail; loud ones as they did."""
    below_db = 10.0
    quiet = quiet_octaves(found, below_db)
    if any(row.freq_hz not in quiet for row in longer):
        return False
    own = [row.before if direction > 0 else row.after for row in longer]
    reverberant = [row.after if direction > 0 else row.before for row in longer]
    loud = [row for row in found.of("octave T60", certain=False) if row.freq_hz not in quiet]
    rests = [row.before if direction > 0 else row.after for row in loud]
    return (
        bool(loud)
        and float(np.median(own)) < 0.75 * float(np.median(reverberant))
        and max(rests) > float(np.median(own))
    )


def _one_decay(longer: list[StateChange], direction: int) -> bool:
    """Whether octaves that rang for times of their own ring for one time with the tail."""
    fewest, apart = 3, 2.0  # times by which their own differ at least, and twice as much as with the tail
    longer = [row for row in longer if row.kind == "octave T60"]
    if len(longer) < fewest:
        return False
    own = [row.before if direction > 0 else row.after for row in longer]
    reverberant = [row.after if direction > 0 else row.before for row in longer]
    spread, left = np.log(max(own) / min(own)), np.log(max(reverberant) / min(reverberant))
    return len(longer) >= fewest and bool(spread > np.log(apart) and left < spread / 2)


def _louder(found: Changes, direction: int) -> bool:
    """Whether an octave above 500 Hz is louder by more than a room's tail makes it."""
    louder_db = 8.0
    return any(direction * row.change > louder_db and row.freq_hz > 500 for row in found.of("octave level"))


def _law(found: Changes, changed: list[StateChange]) -> dict[str, float]:
    """Fit Δd = c (f/1 kHz)^p, p of 0, 1, 2, to the decays added: constant, of a loss factor, of viscosity."""
    freq = np.array([row.freq_hz for row in changed])
    added = np.log(1e3) * (1 / np.array([row.after for row in changed]) - 1 / np.array([row.before for row in changed]))
    numbers = {
        "t60_ratio_median": float(np.median([row.change for row in changed])),
        "t60_ratio_least": float(min(row.change for row in changed)),
        "t60_ratio_most": float(max(row.change for row in changed)),
    }
    if len(freq) >= 3 and ((added > 0).all() or (added < 0).all()):
        slope, level = np.polyfit(np.log(freq / 1000), np.log(np.abs(added)), 1)
        numbers |= {
            "added_decay_exponent": float(slope),
            "added_decay_1khz_per_s": float(np.sign(added[0]) * np.exp(level)),
        }
    return numbers


def _law_words(numbers: dict[str, float]) -> str:
    if "added_decay_exponent" not in numbers:
        return ""
    p = numbers["added_decay_exponent"]
    return f", {numbers['added_decay_1khz_per_s']:.3g}/s at 1 kHz, growing as f^{p:.1f}"


def _noise(found: Changes) -> Cause | None:
    """Name what hisses or rattles: octaves that are noise now, and louder."""
    noise_db = -4.5  # flatness of noise in an octave, and a little
    share, reach = 0.5, 0.8  # of what changed beyond takes, within so many octaves of such an octave
    level = {row.freq_hz: row.change for row in found.of("octave level", certain=False)}
    rows = [
        row
        for row in found.of("octave level")
        if row.change > 6
        and any(
            one.freq_hz == row.freq_hz and one.after > noise_db for one in found.of("octave flatness", certain=False)
        )
        and row.freq_hz >= 500
    ]
    more = [row for row in found.of("octave flatness") if row.change > 3 and level.get(row.freq_hz, -99) > -1]
    lasting = [row for row in found.of("octave T60") if row.change > 1.5 and row.freq_hz >= 500]
    later = [row for row in found.of("octave attack") if row.change < -2 and row.freq_hz >= 500]
    noisy = {row.freq_hz for row in rows}
    certain = [row for row in found.rows if row.certain]
    near = [row for row in certain if any(abs(np.log2(row.freq_hz / one)) < reach for one in noisy)]
    if not rows or not (more or lasting or later) or shifts(found) or len(near) < share * len(certain):
        return None
    return Cause(
        "rattle",
        ("noise",),
        True,
        f"noise-like sound around {', '.join(f'{row.freq_hz:.0f}' for row in rows)} Hz that follows the strike: "
        "something rattles or hisses along",
        "a recording with what may touch it taken away",
        {"loudest_db": max(row.change for row in rows)},
        len(rows) + len(more),
    )


def _added_lines(found: Changes) -> Cause | None:
    share, reach = 0.8, 0.8  # of what changed beyond takes, within so many octaves of such a line
    went, came = gone_and_come(found)
    one, many = (came, went) if len(came) >= len(went) else (went, came)
    if not one or many or _roughness(found) > LEVEL_DB or len(one) > 6:
        return None
    rows = found.of("line level", certain=False)
    loudest = max(max(row.before, row.after) for row in rows)
    if max(max(row.before, row.after) for row in one) < loudest - FAINT_DB:
        return None  # a faint line of the thing comes out of the noise with a harder strike, too
    held = {row.freq_hz for row in found.of("line frequency", certain=False)}
    if sum(row.freq_hz in held and abs(row.change) < GONE_DB for row in rows) < len(one):
        return None  # nothing shows that the thing itself is still there
    certain = [row for row in found.rows if row.certain]
    near = [row for row in certain if any(abs(np.log2(row.freq_hz / line.freq_hz)) < reach for line in one)]
    if len(near) < share * len(certain):
        return None
    direction = "came" if one is came else "went"
    listed = ", ".join(f"{row.freq_hz:.1f}" for row in one)
    return Cause(
        ForeignMode.id,
        ("new-mode",),
        True,
        f"{len(one)} lines {direction} and nothing else moved: another resonator ({listed} Hz)",
        "the sound of what stood beside it, struck alone",
        {f"line_{k + 1}_hz": row.freq_hz for k, row in enumerate(one)},
        len(one),
    )


def _roughness(found: Changes) -> float:
    """Median departure, in dB, of the lines' levels from a smooth curve over frequency, less its spread."""
    rows = _held_levels(found) or [
        row for row in found.of("line level", certain=False) if abs(row.change) < GONE_DB or row.certain
    ]
    if len(rows) < 5:
        return 0.0
    x = np.log(np.array([row.freq_hz for row in rows]))
    y = np.clip([row.change for row in rows], -25, 25)
    sd = np.maximum([(row.high - row.low) / 4 for row in rows], 0.5)
    weight = 1 / sd
    off = y - np.polyval(np.polyfit(x, y, min(2, len(rows) - 3), w=weight), x)
    return float(np.median(np.maximum(np.abs(off) - sd, 0)))


def _held_levels(found: Changes) -> list[StateChange]:
    """Return the levels of lines that both states hold, where they are enough for a curve; others' are bounds."""
    held = {row.freq_hz for row in found.of("line frequency", certain=False)}
    rows = [row for row in found.of("line level", certain=False) if row.freq_hz in held]
    return rows if len(rows) >= 2 * 3 else []  # twice as many as a parabola has numbers


def _levels(found: Changes) -> Cause | None:  # noqa: PLR0911
    rows = [row for row in found.of("line level") + found.of("octave level") if abs(row.change) > LEVEL_DB]
    pulled = _pulled_lines(found)
    if not rows and not pulled:
        return None
    if pulled and not _either_way(pulled):
        return None  # more than levels moved, and nothing is known that moves it so
    if found.shift is not None and not found.shift.stayed(CERTAIN) and not _lines_untouched(found):
        return None  # neither what is loud nor lines show that it is the same thing
    lines = found.of("line level", certain=False)
    if not pulled and len(rows) < 0.1 * len(lines) and not any(row.kind == "octave level" for row in rows):
        return None  # a filter or a striker changes all lines of a band, another place most
    rough = _roughness(found)
    audible = [row for row in found.of("octave level", certain=False) if row.freq_hz not in quiet_octaves(found, 40.0)]
    octaves = sorted(audible, key=lambda row: row.freq_hz)
    change = np.array([row.change for row in octaves])
    numbers = {"roughness_db": rough, "largest_db": max((row.change for row in rows), key=abs, default=0.0)}
    rung = [
        row for row in found.of("octave T60") + found.of("octave late T60") if abs(np.log(row.change)) > np.log(1.5)
    ]
    held = [
        row for row in found.of("line T60", certain=False) if max(abs(np.log(row.low)), abs(np.log(row.high))) < 0.2
    ]
    if rough <= LEVEL_DB and rung and len(held) < 3:  # three lines that ring as they did: octaves hold others of them
        return None  # a filter or a striker changes no decay
    fit = fit_contacts(found)
    if not pulled and fit.explains and fit.chance <= CERTAIN and fit.off_db < LEVEL_DB:
        return _name_contact(found, fit, numbers)
    if not _held_levels(found) and _lost_lines(found) is not None:
        return _lost_lines(found)  # of lines that one state does not hold levels are bounds: nothing says how they go
    if rough > LEVEL_DB or (len(lines) < 5 and not rung):
        return Cause(
            STRIKE_PLACE,
            ("microphone-place", Room.id, *((SupportDamping.id,) if pulled else ())),
            False,
            "levels differ, line by line, and nothing else in one direction: another place of the strike or of the "
            "microphone, or a room's own lines beside them, not another thing",
            "strikes at the same place, with the microphone where it was",
            numbers,
            len(rows),
        )
    if pulled:
        return _name_echoes(sum(map(len, pulled)), len(found.of("line T60", certain=False)), len(rows))
    trend = _steadily(change)
    if trend:
        return Cause(
            ContactTime.id,
            (MeasurementChain.id, "striker", STRIKE_PLACE),
            False,
            f"levels {'fall' if trend < 0 else 'rise'} towards high frequencies, all lines alike: a "
            f"{'softer' if trend < 0 else 'harder'} or {'longer' if trend < 0 else 'shorter'} contact, or a filter",
            "the striker's force, or a recording of the same sound by both chains",
            numbers,
            len(rows),
        )
    return Cause(
        MeasurementChain.id,
        (ContactTime.id, "microphone-place", STRIKE_PLACE),
        False,
        "levels alone differ, all lines alike: a filter of the recording, or another striker",
        "a recording of the same sound by both chains",
        numbers,
        len(rows),
    )


def _lost_lines(found: Changes) -> Cause | None:
    """Name a softer contact, or a harder one, where lines only went, or only came: another place does as often both."""
    went, came = gone_and_come(found)
    changed = len(went) + len(came)
    if (went and came) or 2.0 ** (1 - changed) > CERTAIN:
        return None
    return Cause(
        ContactTime.id,
        (MeasurementChain.id, "striker", DampingLaw.id),
        False,
        f"{changed} lines {'went' if went else 'came'}, and none {'came' if went else 'went'}: a "
        f"{'longer' if went else 'shorter'} contact or a filter, or damping under which nothing rings",
        "the striker's force; takes in which more of its lines are heard",
        {"lines_gone": float(len(went)), "lines_come": float(len(came))},
        changed,
    )


def _pulled_lines(found: Changes) -> list[list[bool]]:
    """Return of lines whose T60 changed, and of those that moved, whether upwards; none where too few did."""
    fewest = 2
    if _lines_untouched(found):
        return []
    rung = [row.change > 1 for row in decays(found) if row.kind == "line T60"]
    moved = [row.change > 0 for row in shifts(found)]
    return [one for one in (rung, moved) if len(one) >= fewest]


def _either_way(pulled: list[list[bool]]) -> bool:
    """Whether lines went up and down, as echoes, neighbours and supports replaced by others pull them."""
    return all(1 - MOST < np.mean(one) < MOST for one in pulled)


def _steadily(change: Array) -> int:
    """Say whether levels (o,) go down (−1) or up (1) with frequency, all but noise; else 0."""
    step = np.diff(change[np.isfinite(change)])
    if not len(step):
        return 0
    total = float(step.sum())
    against = float(np.abs(step[np.sign(step) != np.sign(total)]).sum())
    return int(np.sign(total)) if abs(total) > 4 and against < 0.25 * abs(total) else 0


def _listener(found: Changes) -> Cause:
    longer = [row for row in found.of("octave T60") if abs(np.log(row.change)) > np.log(RATIO)]
    name = Room.id if longer else MeasurementChain.id
    return Cause(
        name,
        ("microphone-place", MeasurementChain.id if longer else Room.id),
        False,
        "the takes are the same strikes, recorded twice: microphone, room or chain differ, and nothing of the body",
        "a recording of the same sound by both microphones at one place",
        {"octaves_t60_changed": float(len(longer))},
        sum(row.certain for row in found.rows),
    )
