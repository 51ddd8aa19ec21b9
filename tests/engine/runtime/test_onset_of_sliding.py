"""Sliding begins as loud as it goes on, whether a body comes down or was there: no click, no louder beginning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import sonic_bullet as sb
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts
from tests.few_cases import parametrize_few
from tests.made.models import WOOD, box_body, row, step

DT = 1 / 240
CORNERS = [(x, y, -0.02) for x in (-0.04, 0.04) for y in (-0.03, 0.03)]


def slid(speed_m_s: float, load_n: float, before: int, seed: int) -> Array:
    """0.6 s of a wooden box on a board that is drawn through under it at one speed and load, after steps in the air."""
    rough = replace(WOOD, roughness_m=3e-6)
    box = box_body((0.08, 0.06, 0.04), np.linspace(900, 9000, 12), rough)
    board = box_body((0.8, 0.4, 0.02), np.linspace(150, 7000, 40), rough, body_id=1, mass_kg=0)
    share = load_n * DT / len(CORNERS)
    rows = [
        row(
            0, 1, (-0.3 * share, 0, share), point_a=at, point_b=(at[0], at[1], 0.01), slip=(speed_m_s, 0, 0),
            sweep=(0, speed_m_s), approach=0.0, gap=-1e-5,
        )
        for at in CORNERS
    ]  # fmt: skip
    places, contacts = [(0.0, 0.0, 0.03), (0.0, 0.0, 0.0)], Contacts.join(rows)
    steps = [step(places, contacts if i >= before else None, gravity=(0, 0, -9.81)) for i in range(before + 150)]
    log = ContactLog((box, board), tuple(steps), (sb.Microphone((0.0, -0.5, 0.3)),), 48_000, seed)
    return np.asarray(sb.render_log(log)[0, round(before * DT * 48_000) :])


@parametrize_few("speed_m_s, before", [(0.3, 0), (0.3, 20), (1.0, 0), (1.0, 20)], 1)
def test_the_onset_is_as_loud_as_what_follows(speed_m_s: float, before: int) -> None:
    """Of eight surfaces the mean power: the first 100 ms and its first 20 ms over the 0.5 s that follow."""
    power = np.mean([slid(speed_m_s, 1.3, before, seed)[:28_800] ** 2 for seed in range(8)], axis=0)
    on = power[4800:].mean()
    begin, first = (10 * float(np.log10(part.mean() / on)) for part in (power[:4800], power[:960]))
    print(f"{speed_m_s} m/s after {before} steps: first 100 ms {begin:+.1f} dB, first 20 ms {first:+.1f} dB")
    assert abs(begin) < 3
    assert first < 1
