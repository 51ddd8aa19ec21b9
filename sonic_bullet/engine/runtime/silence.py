"""Reasons why a render is silent, read off its log, so that users need no debugger.

samples + ContactLog -> silent? -> the first of: no microphone, no step, nothing added, teleported, nothing touched,
only others touched,
                                   no audible mode, a vibrometer elsewhere, a smooth partner, support at rest, not
                                   there yet, far away, too soft
                   almost silent? -> the first mechanism that was near to sounding, and what took it away

The cause is asked of what happened, not of the level: a slide over what is smooth is no matter of microphones.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sonic_bullet.engine.bank.resonator import Resonator, build_resonator
from sonic_bullet.engine.contact.load_splitting import SLIDES_M_S, SPAN, settling_m_s
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import as_sound
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.radiation.compact import COMPACT
from sonic_bullet.radiation.radiated import radiation_note
from sonic_bullet.records import Array, Body, Microphone, Vibrometer, channel_sensors
from sonic_bullet.records.contacts import Contacts
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.simulated import with_body_id
from sonic_bullet.records.units import REFERENCE_PRESSURE_PA


def silence_notes(samples: Array | KeptSound, log: ContactLog) -> tuple[str, ...]:
    """Return one note that says why (channels, n) samples are silent; none where they are not.

    Silent: no channel, none but zeros, or no pressure above the threshold of hearing, 20 µPa.
    """
    if not log.sensors:
        return (f"the render is silent: {why_silent(log)}",)
    peaks = as_sound(samples).peaks()
    if not is_silent(samples, log):
        why = why_silent(log) if is_faint(peaks, log) else None
        return (f"the render is almost silent, its peak {peaks.max():.2g} Pa: {why}",) if why else ()
    unknown = (
        _too_faint(log, peaks) if peaks.any() else "its log does not say why: write it with --contacts and report it"
    )
    return (f"the render is silent: {why_silent(log) or unknown}",)


def is_faint(peaks: Array, log: ContactLog) -> bool:
    """Return whether all peaks (channels,) are pressures below 20 dB SPL: a quiet room's own noise."""
    microphones = all(isinstance(sensor, Microphone) for sensor in channel_sensors(log.sensors))
    return microphones and bool(peaks.max(initial=0.0) < 10 * REFERENCE_PRESSURE_PA)


def is_silent(samples: Array | KeptSound, log: ContactLog) -> bool:
    """Return whether no pressure in (channels, n) samples is above the threshold of hearing, 20 µPa."""
    peaks = as_sound(samples).peaks()
    sensors = channel_sensors(log.sensors)
    least = np.array([REFERENCE_PRESSURE_PA if isinstance(sensor, Microphone) else 0.0 for sensor in sensors])
    return not bool((peaks > least).any())


def render_notes(samples: Array | KeptSound, log: ContactLog) -> tuple[str, ...]:
    """Return notes on a render: why it is silent, or which of its bodies are."""
    return silence_notes(samples, log) or body_notes(log)


def body_notes(log: ContactLog) -> tuple[str, ...]:
    """Return notes on added bodies that are silent or simplified, each kind in one note.

    Kinds: not touched, no mode in the band, a sensor on a body that was not added, radiation by a simpler law.
    """
    many_silent = 20
    untouched = "touched by nobody, so silent"
    rows, added = log.rows, [i for i, body in enumerate(log.bodies) if body.material is not None]
    touched = set(np.unique(np.concatenate([rows.a, rows.b])).tolist())
    alone = [b for i in added if i not in touched and can_sound(b := log.bodies[i])]
    models = [(log.bodies[i], model) for i in added if (model := log.bodies[i].model) is not None and len(model.face)]
    dull = [body for body, model in models if not model.unsolved and not (model.freq_hz < log.sr / 2).any()]
    faint = [b for i in added if i in touched and (b := log.bodies[i]).model is not None and b.model.unsolved]
    notes = []
    if alone and log.steps:
        notes.append(f"{untouched}: {_names(alone, many_silent)}")
    if faint:
        notes.append(
            f"no blow and no slide that could be heard, so its modes were not solved: {_names(faint, many_silent)}"
        )
    for still, said in ((False, "they click but do not ring"), (True, "they do not move either, so they are silent")):
        mute = [body for body in dull if (body.mass_kg == 0) == still]
        if mute:
            notes.append(f"no mode below {min(20_000.0, log.sr / 2):g} Hz: {_names(mute, many_silent)}; {said}")
    here = {(body.body_id, body.link) for body in log.bodies if body.material is not None}
    off = [one for one in log.sensors if isinstance(one, Vibrometer) and (one.body_id, one.link) not in here]
    if off and here:
        places = ", ".join(sorted({_read_place(one, log) for one in off}))
        notes.append(f"the {off[0].kind} is on {places}, which was not added, so it reads nothing; add it")
    if any(isinstance(sensor, Microphone) for sensor in log.sensors):
        simple = [body for body, model in models if radiation_note(model, log.air)]
        if simple:
            notes.append(f"{COMPACT}: {_names(simple, many_silent)}")
    return tuple(notes)


def can_sound(body: Body) -> bool:
    """Return whether a body may ring or click: ground, which has no modes and never moves, makes no sound."""
    return body.mass_kg > 0 or (body.model is not None and len(body.model.face) > 0)


def why_silent(log: ContactLog) -> str | None:
    """Return why a log has no sound, with a remedy, in one line; None where something in it should sound."""
    if not log.sensors:
        return "there is no microphone; give one, such as (0, -1, 0.5)"
    if not log.steps:
        return "there is no physics step; call stepSimulation"
    rows, added = log.rows, np.array([body.material is not None for body in log.bodies], bool)
    if not added.any():
        return (
            "nothing was added, so no body has a material; call listener.add(body, material=…)"
            if len(rows)
            else "no body that can sound is there, and nothing touched; load one and let it fall"
        )
    mine = np.flatnonzero(added[rows.a] | added[rows.b])
    if not len(mine):
        return _explain_untouched(log, rows, added)
    silenced = [body for body in log.bodies if body.silent]
    sounding = np.array(
        [one and not body.silent and can_sound(body) for one, body in zip(added, log.bodies, strict=True)]
    )
    if silenced and not sounding[np.concatenate([rows.a[mine], rows.b[mine]])].any():
        return f"every sounding body that was touched is silenced by --silent: {_names(silenced)}; name fewer"
    touched = np.unique(np.concatenate([rows.a[mine], rows.b[mine]]))
    resonators = [build_resonator(log.bodies[i], log.sensors, log.sr, log.air) for i in touched if added[i]]
    unsolved = any((model := log.bodies[i].model) is not None and model.unsolved for i in touched if added[i])
    return (
        (None if unsolved else _mute(log, resonators))
        or _smooth_partner(log, rows, mine)
        or _at_rest(log, rows, mine)
        or _arrives_late(log, mine)
    )


def _explain_untouched(log: ContactLog, rows: Contacts, added: Array) -> str:
    """Explain why none of the added bodies touched another."""
    by_hand = 0.5  # Fraction of its steps in which a body was teleported, from which on that is what moves it
    named = _names(body for body, one in zip(log.bodies, added, strict=True) if one and can_sound(body))
    moved = np.zeros(len(added))
    lived = np.zeros(len(added))
    for step in log.steps:
        moved[step.body] += step.teleported
        lived[step.body] += 1
    hand = np.flatnonzero((moved > 0) & (moved >= by_hand * lived))
    if len(hand):
        return (
            f"{_names(log.bodies[i] for i in hand)} was moved by hand in {int(moved[hand].max())} of "
            f"{format_count(len(log.steps), 'step')}, "
            "and what is set somewhere presses on nothing; move it by forces, velocities or constraints"
        )
    if len(rows):
        others = _names(log.bodies[i] for i in np.unique(np.concatenate([rows.a, rows.b])))
        return f"only bodies that were not added touched ({others}), while {named} met nobody; add what shall sound"
    if not moved.any() and not any(step.gravity_m_s2.any() for step in log.steps) and not _moves(log, added):
        return (
            f"nothing touched: there is no gravity, and {named} stayed where it was; call setGravity(0, 0, -9.81), or "
            "give velocities"
        )
    return f"nothing touched: {named} met nobody in {log.duration_s:.3g} s; run for longer, or let them meet"


def _moves(log: ContactLog, chosen: Array) -> bool:
    """Return whether any of the chosen bodies is elsewhere at a step than where it began."""
    began: dict[int, Array] = {}
    for step in log.steps:
        for number, place in zip(step.body.tolist(), step.position_m, strict=True):
            if chosen[number] and (began.setdefault(number, place) != place).any():
                return True
    return False


def _mute(log: ContactLog, resonators: list[Resonator]) -> str | None:
    """Explain why no sensor can hear any of the bodies that were touched."""
    readers = [sensor for sensor in log.sensors if isinstance(sensor, Vibrometer)]
    ringing = [resonator for resonator in resonators if resonator.mode_count]
    if len(readers) == len(log.sensors):
        moving = [one for one in resonators if one.mode_count or one.rigid_columns]
        there = {(one.body.body_id, one.body.link) for one in ringing}
        joined = {one.body.body_id for one in moving if one.rigid_columns}
        if moving and not any((sensor.body_id, sensor.link) in there or sensor.body_id in joined for sensor in readers):
            places = ", ".join(sorted({_read_place(sensor, log) for sensor in readers}))
            struck = _names(s.body for s in moving)
            return f"the {readers[0].kind} is on {places}, and only {struck} was touched; put it there"
    if ringing or any(one.rigid_columns for one in resonators):
        return None
    if any(isinstance(sensor, Microphone) for sensor in log.sensors) and any(
        resonator.translation is not None for resonator in resonators
    ):
        return None  # it clicks
    higher = [
        resonator.body
        for resonator in resonators
        if resonator.body.model is not None and resonator.body.model.mode_count
    ]
    if higher:
        return (
            f"no audible mode: those of {_names(higher)} are at or above half the sample rate, {log.sr / 2:g} "
            "Hz, or overdamped; give a higher sr"
        )
    return (
        f"no audible mode: {_names(resonator.body for resonator in resonators)} has none below 20 kHz and does "
        "not move freely; a larger or thinner body rings"
    )


def _read_place(sensor: Vibrometer, log: ContactLog) -> str:
    bodies = [one for one in log.bodies if (one.body_id, one.link) == (sensor.body_id, sensor.link)]
    base = f"body {sensor.body_id}" + (f" link {sensor.link}" if sensor.link >= 0 else "")
    return _names(bodies[:1]) if bodies else base


def _smooth_partner(log: ContactLog, rows: Contacts, mine: Array) -> str | None:
    """Detect that what slides or rolls sweeps hardly anything but smooth surfaces."""
    least_steps = 2 * SPAN
    nearly_all = 0.9  # of load times sweep: a body that slides tips a little, and sweeps its own edge
    smooth = np.array([_is_smooth(body) for body in log.bodies], bool)
    sweeps = rows.sweep_m_s[mine] > SLIDES_M_S
    swept_smooth = np.stack([smooth[rows.a[mine]], smooth[rows.b[mine]]], axis=1)
    load = np.abs(np.einsum("kx,kx->k", rows.impulse_n_s[mine], rows.normal[mine]))
    swept = load[:, None] * np.where(sweeps, rows.sweep_m_s[mine], 0.0)
    if (
        not swept[swept_smooth].sum() > nearly_all * swept.sum()
        or len(np.unique(log.step[mine][sweeps.any(axis=1)])) < least_steps
    ):
        return None
    sweeps &= swept_smooth
    partners = np.unique(np.concatenate([rows.a[mine][sweeps[:, 0]], rows.b[mine][sweeps[:, 1]]]))
    which = [log.bodies[i] for i in partners]
    fastest = float(rows.sweep_m_s[mine][sweeps].max())
    stranger = [body for body in which if body.material is None]
    why = "was not added and moves, and so is taken as smooth; add it" if stranger else "has a roughness of 0; give one"
    over = stranger or which
    each = "each of " if len(over) > 1 else ""
    return f"it slides or rolls at up to {fastest:.2g} m/s over {_names(over)}, {each}which {why}"


def _is_smooth(body: Body) -> bool:
    """Return whether nothing is swept on a body's surface: of a moving one that was not added, or a given zero."""
    if body.material is None:
        return body.mass_kg > 0
    given = body.material.octave_rms_m
    rough = body.material.roughness_m > 0 if given is None else bool(np.any(given > 0))
    return not rough and body.material.form is None


def _too_faint(log: ContactLog, peaks: Array) -> str:
    """Explain a sound that nobody hears: by its distance, or by how soft what happened is."""
    near_m = 3.0  # nearer than that no microphone is moved for the level's sake
    faint = f"its peak of {peaks.max():.2g} Pa is below the threshold of hearing, 20 µPa"
    places = [one.position_m for one in log.sensors if isinstance(one, Microphone) and not one.moves]
    rows = log.rows
    if not places or not len(rows):
        return f"{faint}: --peak-dbfs -1 scales it"
    first = log.steps[int(log.step[0])]
    away = float(min(np.linalg.norm(first.position_m - place, axis=1).min() for place in places))
    if away > near_m:
        return f"{faint}: the nearest microphone is {away:.3g} m away; move it nearer, or --peak-dbfs -1 scales it"
    fastest, most = float(rows.approach_m_s.max()), float(np.linalg.norm(rows.impulse_n_s, axis=1).max())
    return (
        f"{faint}: nothing approached faster than {max(fastest, 0.0):.2g} m/s, the largest impulse is {most:.2g} N·s; "
        "let it fall from higher, or --peak-dbfs -1 scales it"
    )


def _at_rest(log: ContactLog, rows: Contacts, mine: Array) -> str | None:
    """Detect that bodies only rest: nothing approached faster than gravity in settling, nothing slid or rolled."""
    step = log.step[mine]
    fall = np.concatenate([block.step["gravity_m_s2"] * block.step["dt_s"][:, None] for block in log.blocks()])[step]
    slides = np.unique(step[(rows.sweep_m_s[mine] > SLIDES_M_S).any(axis=1)])
    # shorter contact is settling, no support yet
    if (rows.approach_m_s[mine] > settling_m_s(fall, rows.normal[mine])).any() or len(slides) > SPAN:
        return None
    fastest = float(rows.approach_m_s[mine].max())
    return (
        f"all {len(mine)} contacts are support at rest: nothing approached faster than {max(fastest, 0.0):.2g} "
        "m/s and nothing slid; let something fall"
    )


def _arrives_late(log: ContactLog, mine: Array) -> str | None:
    """Detect that the sound of the first contact would reach every microphone only after the end."""
    places = [one.position_m for one in log.sensors if isinstance(one, Microphone) and not one.moves]
    if len(places) < len(log.sensors):
        return None
    first = log.steps[int(log.step[mine[0]])]
    away = float(min(np.linalg.norm(first.position_m - place, axis=1).min() for place in places))
    begins_s, travels_s = float(log.time_s[mine[0]]), away / log.air.sound_speed_m_s
    if begins_s + travels_s < log.duration_s:
        return None
    return (
        f"the sound is still under way at the end: it needs {travels_s:.2g} s for the {away:.3g} m from the first "
        f"contact, at {begins_s:.3g} s, to the nearest microphone; run for longer, or move it nearer"
    )


def _names(bodies: Iterable[Body], most: int = 3) -> str:
    names = [with_body_id(body.name, body.body_id) for body in bodies]
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
