"""Microphones in space against closed forms: directions, delays of what moves, ears, and the same bits however cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from sonic_bullet.engine.path.space.ear_filters import ear_filters, onsets
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.replay import log_frames, render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Ambisonics, Array, Binaural, Microphone, MicrophonePath, Sensor
from sonic_bullet.records.contacts import Contacts
from sonic_bullet.records.errors import AudioError, RecordError
from tests.few_cases import parametrize_few
from tests.made import heads
from tests.made.models import STEEL, box_body, row, step, wall_body

SR, C, DT_S = 48_000, 343.0, 1 / 240
TONE_HZ = 1500.0
QUIET = replace(STEEL, alpha_per_s=1.0, beta_s=0.0)


def struck(sensors: tuple[Sensor, ...], place: Array, *, steps: int = 24, tones: int = 1) -> ContactLog:
    """A box struck in step 2 at places (3,) or (steps, 3), by a wall that is silent."""
    freq = tuple(TONE_HZ * (1 + 0.7 * k) for k in range(tones))
    at = np.broadcast_to(place, (steps, 3))
    hit = row(0, 1, (0, 0, -0.01), normal=(0, 0, -1), point_a=(0, 0, 0.005))
    bodies = box_body((0.2, 0.1, 0.01), freq, QUIET), wall_body()
    made = [step([at[i], at[i] + [0, 0, 0.01]], hit if i == 2 else Contacts.none(), dt_s=DT_S) for i in range(steps)]
    return ContactLog(bodies, tuple(made), sensors, SR, 0)


@parametrize_few("order", [1, 2, 3], 2)
def test_ambisonics_decode_to_direction_and_level(order: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By spaudiopy's harmonics: the loudest direction within 1°, its level within 0.1 dB of the plain microphone."""
    import scipy.special

    # spaudiopy 0.2 asks for a function that scipy 1.17 has under another name
    former = lambda m, n, azimuth, zenith: scipy.special.sph_harm_y(n, m, zenith, azimuth)  # noqa: E731
    monkeypatch.setattr(scipy.special, "sph_harm", former, raising=False)
    spa = pytest.importorskip("spaudiopy")
    rng = np.random.default_rng(order)
    azimuth, colatitude = np.meshgrid(np.radians(np.arange(0, 360, 0.5)), np.radians(np.arange(1, 180, 0.5)))
    degree = np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)
    grid = spa.sph.sh_matrix(order, azimuth.ravel(), colatitude.ravel(), "real") * np.sqrt(4 * np.pi)
    weight = np.sqrt(2 * degree + 1) / (order + 1) ** 2  # SN3D to N3D, and a plane wave to 1
    for unit in Rotation.random(3, rng=rng).apply([1.0, 0, 0]):
        place = np.array([0.1, -0.2, 0.3])
        log = struck((Ambisonics(place, order=order), Microphone(place)), place + 1.2 * unit, steps=8)
        sound = render_log(log)
        field, plain = sound[:-1], sound[-1]
        assert np.array_equal(field[0], plain)
        found = (field @ plain) / (plain @ plain)  # each channel's share of the pressure: Y
        decoded = grid @ (found * weight)
        best = int(np.argmax(decoded))
        a, z = azimuth.ravel()[best], colatitude.ravel()[best]
        toward = np.array([np.sin(z) * np.cos(a), np.sin(z) * np.sin(a), np.cos(z)])
        assert np.degrees(np.arccos(min(1.0, toward @ unit))) < 1
        assert abs(20 * np.log10(decoded[best])) < 0.1
        exact = spa.sph.sh_matrix(order, np.arctan2(unit[1], unit[0]), np.arccos(unit[2]), "real")[0]
        np.testing.assert_allclose(found, exact * np.sqrt(4 * np.pi / (2 * degree + 1)), atol=1e-9)


def test_a_turned_microphone_hears_in_its_own_frame() -> None:
    turn = Rotation.from_euler("zyx", [70, -20, 10], degrees=True)
    unit = np.array([0.6, 0.0, 0.8])
    turned = Ambisonics(np.zeros(3), turn.as_quat(), order=1)
    sound = render_log(struck((turned,), turn.apply(unit), steps=8))
    share = (sound @ sound[0]) / (sound[0] @ sound[0])
    np.testing.assert_allclose(share[[3, 1, 2]], unit, atol=1e-9)


def passing(moves: str) -> tuple[Array, Array, Array]:
    """What a microphone and a body that pass each other at 10 m/s sound like, what the closed form gives, and times."""
    steps, speed, aside = 200, 10.0, np.array([0.0, 0.5, 0.2])
    time_s = np.arange(steps) * DT_S
    along = np.stack([speed * (time_s - 0.4), np.zeros(steps), np.zeros(steps)], axis=1)
    still = render_log(struck((Microphone(aside),), np.zeros(3), steps=steps))[0]
    rest_m = float(np.linalg.norm(aside))
    t = np.arange(still.size) / SR
    if moves == "body":
        sound = render_log(struck((Microphone(aside),), along, steps=steps))[0]
        late = np.full(t.shape, rest_m / C)  # r(t - D) = c D, by fixed point
        for _ in range(30):
            x = speed * (t - late - 0.4)
            late = np.hypot(x, rest_m) / C
    else:
        microphone = Microphone(path=MicrophonePath(time_s, aside - along))
        sound = render_log(struck((microphone,), np.zeros(3), steps=steps))[0]
        late = np.hypot(speed * (t - 0.4), rest_m) / C
    from scipy.interpolate import make_interp_spline

    source = make_interp_spline(t, still * rest_m, k=9)(np.clip(t + rest_m / C - late, 0, t[-1])) / (late * C)
    return sound, source, t


@pytest.mark.parametrize("moves", ["body", "microphone"])
def test_passing_by_shifts_pitch_and_clicks_nowhere(moves: str) -> None:
    """Pitch within 0.1 % of Doppler's law; nothing else above −90 dB, −78 for what moves by 240 places a second."""
    sound, want, t = passing(moves)
    inner = (t > 0.06) & (t < 0.78)
    error = (sound - want)[inner]
    peak = float(np.abs(want).max())
    assert 20 * np.log10(np.abs(error).max() / peak) < (-90 if moves == "body" else -78)
    high = sosfiltfilt(butter(8, 6000, "high", fs=SR, output="sos"), sound)[inner]
    assert 20 * np.log10(np.abs(high).max() / peak) < -90
    phase = np.unwrap(np.angle(_analytic(sound)))
    for at in (0.1, 0.7):
        here = (t > at - 0.02) & (t < at + 0.02)
        slope = np.polyfit(t[here], phase[here], 1)[0] / (2 * np.pi)
        exact = np.polyfit(t[here], np.unwrap(np.angle(_analytic(want)))[here], 1)[0] / (2 * np.pi)
        assert slope == pytest.approx(exact, rel=1e-3)
        toward = 1 if at < 0.4 else -1
        assert (slope / TONE_HZ - 1) * toward == pytest.approx(10 / C, rel=0.1)


def _analytic(sound: Array) -> Array:
    from scipy.signal import hilbert

    return np.asarray(hilbert(sound))


def test_a_microphone_on_a_body_is_one_on_its_path() -> None:
    """It rides on the wall, which turns nowhere; what it hears is what a path of the same places hears."""
    steps = 60
    time_s = np.arange(steps) * DT_S
    at = np.stack([2.0 * time_s, 0.3 * np.sin(8 * time_s), np.zeros(steps)], axis=1)
    log = struck((), at * 0, steps=steps)
    made = tuple(
        replace(one, position_m=np.array([[0.0, 0, 0], at[i] + [0, 0.5, 0]])) for i, one in enumerate(log.steps)
    )
    log = replace(log, steps=made)
    rides = render_log(replace(log, sensors=(Microphone([0.1, 0.0, 0.2], body_id=9),)))[0]
    place = at + np.array([0.1, 0.5, 0.2])
    path = render_log(replace(log, sensors=(Microphone(path=MicrophonePath(time_s, place)),)))[0]
    inner = slice(None, round(55 * DT_S * SR))  # at its end a path stops, and a body flies on
    assert np.abs(rides - path)[inner].max() < 1e-3 * np.abs(path).max()  # it flies on straight, for 1.6 ms


HEAD = heads.head()


def test_a_measured_direction_is_the_heads_own_response() -> None:
    direction = HEAD.direction[123]
    sound = render_log(struck((Binaural(np.zeros(3), head=HEAD), Microphone(np.zeros(3))), 1.5 * direction, tones=3))
    for ear in range(2):
        want = np.convolve(sound[2], HEAD.response[123, ear])
        late = 16  # the filters' margin
        np.testing.assert_allclose(sound[ear, late:], want[: sound.shape[1] - late], atol=1e-9 * np.abs(sound[2]).max())


@parametrize_few("rate", [48_000, 44_100, 96_000], 2)
def test_ears_keep_time_and_level_between_directions(rate: int) -> None:
    """Interaural time within 20 µs, level within 0.5 dB of the head's law, at directions it was not measured at."""
    filters = ear_filters(heads.head(rate, taps=128 * rate // 48_000), SR)
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(200, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    made = filters.at(unit)
    late_s, level = onsets(made) / SR, 10 * np.log10((made**2).sum(axis=-1))
    want_s, want = heads.delay_s(unit), 20 * np.log10(heads.gain(unit))
    assert np.abs((late_s[:, 0] - late_s[:, 1]) - (want_s[:, 0] - want_s[:, 1])).max() < 20e-6
    assert np.abs((level[:, 0] - level[:, 1]) - (want[:, 0] - want[:, 1])).max() < 0.5


def test_live_in_blocks_and_replayed_are_the_same_bits() -> None:
    """A moving body, a turning head, ambisonics, a plain microphone and one on a path, side by side; stems add up."""
    steps = 40
    time_s = np.arange(steps) * DT_S
    at = np.stack([np.sin(5 * time_s), 0.8 + 0 * time_s, 0.1 * time_s], axis=1)
    turned = Rotation.from_euler("z", 4 * time_s[:, None]).as_quat()
    path = MicrophonePath(time_s, np.zeros((steps, 3)), turned)
    sensors = (
        Binaural(path=path, head=HEAD),
        Ambisonics(np.zeros(3), order=2),
        Microphone(np.zeros(3)),
        Microphone(path=MicrophonePath(time_s, -at)),
    )
    log = struck(sensors, at, steps=steps, tones=3)
    whole = render_log(log)
    assert whole.shape[0] == 2 + 9 + 1 + 1
    live = np.concatenate([*log_frames(log)], axis=1)
    lag = 3 * 200
    assert np.array_equal(live[:, lag:], whole[:, : live.shape[1] - lag])
    stems = [frame.sum(axis=0) for _, frame in render_per_body(log)]
    np.testing.assert_allclose(np.concatenate(stems, axis=1), whole, atol=1e-12 * np.abs(whole).max())
    plain = render_log(replace(log, sensors=sensors[2:3]))
    assert np.array_equal(plain[0], whole[11])


def test_what_cannot_be_is_one_line() -> None:
    with pytest.raises(AudioError, match="microphone 0 lies within box0"):
        render_log(struck((Microphone(np.array([0.01, 0.0, 0.0])),), np.zeros(3)))
    with pytest.raises(AudioError, match="moves with body 4"):
        render_log(struck((Microphone(np.zeros(3), body_id=4),), np.ones(3)))
    with pytest.raises(RecordError, match="order"):
        Ambisonics(np.zeros(3), order=4)
    with pytest.raises(RecordError, match="ascend"):
        MicrophonePath(np.array([0.0, 0.0]), np.zeros((2, 3)))
    with pytest.raises(RecordError, match="head"):
        Binaural(np.zeros(3))
