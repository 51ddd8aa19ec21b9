"""A room against closed forms and pyroomacoustics: each image a body behind a wall, Eyring's decay, its energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sonic_bullet.engine.path.room.image_microphones import own_channels
from sonic_bullet.engine.path.room.late_field import late_filters
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Air, Ambisonics, Array, Binaural, Microphone, MicrophonePath, Sensor, ShoeboxRoom
from sonic_bullet.records.contacts import Contacts
from tests.few_cases import parametrize_few
from tests.made import heads
from tests.made.models import STEEL, box_body, row, step, wall_body

pra = pytest.importorskip("pyroomacoustics")
SR, C, DT_S = 48_000, 343.0, 1 / 240
SIZE = (0.2, 0.1, 0.01)
SHORT = replace(STEEL, alpha_per_s=4000.0, beta_s=0.0)
HEAD = heads.head(SR, heads.directions(30), taps=100)


def struck(sensors: tuple[Sensor, ...], place: Array, *, steps: int = 24) -> ContactLog:
    """A box struck along x in step 2 at places (3,) or (steps, 3), by a wall that is silent."""
    at = np.broadcast_to(place, (steps, 3))
    hit = row(0, 1, (-0.01, 0, 0), normal=(-1, 0, 0), point_a=(0.1, 0, 0))
    bodies = box_body(SIZE, (700.0, 1500.0, 3100.0), SHORT), wall_body()
    made = [step([at[i], at[i] + [0.1, 0, 0]], hit if i == 2 else Contacts.none(), dt_s=DT_S) for i in range(steps)]
    return ContactLog(bodies, tuple(made), sensors, SR, 0)


TURN = Rotation.from_euler("zyx", [70, -20, 10], degrees=True).as_quat()
PATH = MicrophonePath([0.0, 0.1], [[0.3, -0.4, 1.9], [0.4, -0.3, 1.9]], [TURN, [0, 0, 0, 1]])
EARS = (
    Microphone([0.3, -0.4, 1.9]),
    Ambisonics([0.3, -0.4, 1.9], TURN, order=3),
    Binaural([0.3, -0.4, 1.9], TURN, head=HEAD),
    Ambisonics(path=PATH, order=1),
)


@parametrize_few("ear", EARS, (0, 1, 2))
def test_a_wall_sends_what_the_same_body_behind_it_would(ear: Microphone) -> None:
    """The floor of a hall: until the other walls answer, the echo is a body behind it, times sqrt(1 - α)."""
    steps = 12
    along = np.array([[0.5 * t, 0.2 * t, 1.1 + 0.3 * t] for t in DT_S * np.arange(steps)])
    hall = ShoeboxRoom([30, 30, 30], 0.75, [-15, -15, 0])
    dry = render_log(struck((ear,), along, steps=steps))
    echo = render_log(struck((ear,), along, steps=steps), room=hall) - dry
    behind = render_log(struck((ear,), along * [1, 1, -1], steps=steps))
    assert np.abs(behind).max() > 1e-5
    np.testing.assert_allclose(echo, 0.5 * behind, atol=1e-6 * np.abs(behind).max())


def decay_of(sound: Array) -> Array:
    """Energy left, in dB re all of it (n,) [Schroeder 1965]."""
    left = np.cumsum(sound[::-1] ** 2)[::-1]
    return 10 * np.log10(np.maximum(left / left[0], 1e-30))


def t60_s(sound: Array) -> float:
    """By the slope from -5 to -35 dB (T30) [ISO 3382-1:2009]."""
    level = decay_of(sound)
    here = (level < -5) & (level > -35)
    return -60 / float(np.polyfit(np.flatnonzero(here) / SR, level[here], 1)[0])


@parametrize_few("size", [(6, 4, 3), (12, 9, 5), (3, 2.5, 2.4), (8, 3, 2.5)], 2)
@pytest.mark.parametrize("alpha", [0.08, 0.2, 0.5])
def test_a_room_dies_as_eyring_says(size: tuple[float, float, float], alpha: float) -> None:
    """Within 10 % of pyroomacoustics' figure of Eyring's law."""
    x, y, z = size
    want = pra.rt60_eyring(2 * (x * y + y * z + z * x), x * y * z, alpha, 0.0, C)
    log = struck((Microphone([0.5, 0.6, 0.4]),), np.zeros(3), steps=round((1.2 * want + 0.05) / DT_S))
    room = ShoeboxRoom(size, alpha, [-x / 2 - 0.3, -y / 2 + 0.2, -z / 2])
    assert t60_s(render_log(log, room=room)[0]) == pytest.approx(want, rel=0.1)


@parametrize_few("size", [(6, 4, 3), (12, 9, 5), (8, 3, 2.5)], 1)
@pytest.mark.parametrize("alpha", [0.65, 0.8, 0.95])
def test_a_room_of_absorbing_walls_dies_as_eyring_says(size: tuple[float, float, float], alpha: float) -> None:
    """Within 10 %, of what the walls send back, over six places: there are too few echoes for one [ISO 3382-1]."""
    x, y, z = size
    want = pra.rt60_eyring(2 * (x * y + y * z + z * x), x * y * z, alpha, 0.0, C)
    ears = np.random.default_rng(3).uniform(-1, 1, (6, 3)) * (np.array(size) / 2 - 0.5)
    log = struck(tuple(Microphone(ear) for ear in ears), np.zeros(3), steps=round((1.2 * want + 0.1) / DT_S))
    dry = render_log(log)
    echo = render_log(log, room=ShoeboxRoom(size, alpha, [-x / 2 - 0.3, -y / 2 + 0.2, -z / 2])) - dry
    first = [int(np.flatnonzero(one)[0]) for one in dry]
    energy = sum(np.pad(one[at:], (0, at)) ** 2 for one, at in zip(echo, first, strict=True))
    assert t60_s(np.sqrt(energy)) == pytest.approx(want, rel=0.1)


def test_octaves_die_each_by_its_own_absorption() -> None:
    """Those of 500 Hz and of 4 kHz, within 10 % of a room that absorbs as much at all frequencies, there."""
    from scipy.signal import butter, sosfiltfilt

    alpha = [0.4, 0.4, 0.4, 0.2, 0.1, 0.1]
    log, corner = struck((Microphone([0.5, 0.6, 0.4]),), np.zeros(3), steps=280), [-3.2, -1.9, -1.2]
    echo = render_log(log, room=ShoeboxRoom([6, 4, 3], alpha, corner))[0]
    for at, hz in ((2, 500), (5, 4000)):
        octave = butter(4, [hz / 2**0.25, hz * 2**0.25], "band", fs=SR, output="sos")
        even = render_log(log, room=ShoeboxRoom([6, 4, 3], alpha[at], corner))[0]
        found, want = (t60_s(sosfiltfilt(octave, one)) for one in (echo, even))
        assert found == pytest.approx(want, rel=0.1)


def test_echoes_give_way_to_a_tail_of_their_energy() -> None:
    """Within 1.5 dB of the energy that pyroomacoustics finds with a hundred times as many images, at eight places."""
    rng = np.random.default_rng(1)
    size, alpha, corner = np.array([6.0, 4, 3]), 0.2, np.array([-3.3, -1.8, -1.4])
    ears = rng.uniform(-1.2, 1.2, (8, 3)) * [1.5, 1, 0.7]
    log = struck(tuple(Microphone(ear) for ear in ears), np.zeros(3), steps=40)
    dry, wet = render_log(log), render_log(log, room=ShoeboxRoom(size, alpha, corner))
    pieces_s = np.array([[0.0, 0.005], [0.005, 0.02], [0.02, 0.03], [0.03, 0.05], [0.05, 0.08]])
    energy = np.zeros((2, len(pieces_s)))
    for c, ear in enumerate(ears):
        alone, all_of_it = (_response(size, alpha, -corner, ear - corner, order) for order in (0, 20))
        theirs = np.convolve(all_of_it, dry[c]) / np.sqrt((alone**2).sum())  # their direct sound is 1 then
        first = int(np.flatnonzero(dry[c])[0])
        for k, sound in enumerate((wet[c, first:], theirs[first + int(np.argmax(alone)) :])):
            energy[k] += [(sound[i:j] ** 2).sum() for i, j in np.round(pieces_s * SR).astype(int)]
    assert np.abs(10 * np.log10(energy[0] / energy[1])).max() < 1.5


def _response(size: Array, alpha: float, source: Array, ear: Array, order: int) -> Array:
    box = pra.ShoeBox(size, fs=SR, materials=pra.Material(alpha), max_order=order)
    box.add_source(source)
    box.add_microphone(ear)
    box.compute_rir()
    return np.asarray(box.rir[0][0])


def test_the_tail_is_a_diffuse_field() -> None:
    """Its energy is the closed form's; ambisonics share it by 1/(2l + 1); two points agree by sin(kd)/kd."""
    room, air, apart_m = ShoeboxRoom([6, 4, 3], 0.2), Air(), 0.2
    sensors = (Microphone(np.zeros(3)), Microphone([apart_m, 0, 0]), Ambisonics(np.zeros(3), order=3))
    made = late_filters(room, air, own_channels(sensors), 18, SR, 0.02)
    energy = (made**2).sum(axis=2).sum(axis=1)
    twice_delta = -C * 108 * np.log(0.8) / (4 * 72)
    closed = 4 * np.pi * C / 72 / twice_delta * np.exp(-twice_delta * 0.02)
    level = 10 * np.log10(energy / closed)
    degree = np.floor(np.sqrt(np.arange(16)))
    assert abs(level[0]) < 0.3 and abs(level[1]) < 0.3
    np.testing.assert_allclose(level[2:], -10 * np.log10(2 * degree + 1), atol=1.5)
    spectrum = np.fft.rfft(made[:2])
    frequency_hz = np.fft.rfftfreq(made.shape[2], 1 / SR)
    for hz in (200, 600, 1200, 2000):
        here = np.abs(frequency_hz - hz) < 100
        a, b = spectrum[:, :, here].reshape(2, -1)
        found = (a * b.conj()).sum().real / np.sqrt((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum())
        assert found == pytest.approx(np.sinc(2 * hz * apart_m / C), abs=0.15)
