"""The picture shows levels that are true and events that happened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.load_leaps import find_leaps
from sonic_bullet.apps.report.plots import scene_plot
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage import spool, spooled_sound
from sonic_bullet.records import Body, Material, Microphone, ModalModel, ModalSum, Vibrometer
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError, FileError

SR = 48_000
DT = 1 / 240


def rows(
    a: int, b: int, impulse_n_s: float, *, slip_m_s: float = 0.0, sweep_m_s: float = 0.0, points: int = 2
) -> Contacts:
    """A pair's contact of one step, shared by some points; friction rides along."""
    k = points
    zero, up = np.zeros((k, 3)), np.tile([0.0, 0.0, 1.0], (k, 1))
    impulse = up * impulse_n_s / k + [0.001, 0, 0]
    return Contacts(
        [a] * k,
        [b] * k,
        point_a_m=zero,
        point_b_m=zero,
        normal=up,
        impulse_n_s=impulse,
        slip_m_s=np.tile([slip_m_s, 0, 0], (k, 1)),
        sweep_m_s=np.full((k, 2), sweep_m_s),
        approach_m_s=np.zeros(k),
        gap_m=np.zeros(k),
    )


def log_of(steps: list[list[Contacts]], bodies: int = 3, silent: tuple[int, ...] = (0,)) -> ContactLog:
    none = np.zeros(0)
    model = ModalModel(none, none, np.zeros((0, 3, 0)), np.zeros((0, 3)), np.zeros((0, 3)), none, 0, 0)
    wood = Material.isotropic("wood", youngs_pa=1e10, poisson=0.3, density_kg_m3=700)
    made = tuple(
        Body(i, -1, 0, f"body {i} $", 0.1, np.eye(3), material=wood, model=None if i in silent else model)
        for i in range(bodies)
    )
    still = (np.zeros((bodies, 3)), np.tile([0, 0, 0, 1.0], (bodies, 1)), np.zeros(bodies, bool))
    return ContactLog(
        made, tuple(Step(DT, *still, Contacts.join(parts)) for parts in steps), (Microphone([0, 0, 1]),), SR, 0
    )


def test_a_strike_is_one_event_at_its_step_with_its_impulse() -> None:
    steps: list[list[Contacts]] = [[] for _ in range(20)]
    steps[7] = [rows(1, 0, 0.02)]
    steps[8] = [rows(1, 0, 0.05)]  # the same blow, second step
    steps[15] = [rows(0, 1, 0.01)]
    events = find_leaps(log_of(steps))
    np.testing.assert_array_equal(events.strike_body, [1, 1])
    np.testing.assert_allclose(events.strike_s, [7 * DT, 15 * DT])
    np.testing.assert_allclose(events.strike_n_s, [0.02, 0.01])
    assert len(events.bar_kind) == 0


def test_both_sounding_bodies_of_a_pair_are_struck() -> None:
    events = find_leaps(log_of([[], [rows(2, 1, 0.3)], []]))
    assert sorted(events.strike_body) == [1, 2]


@pytest.mark.parametrize(
    ("slip", "sweep", "kind"), [(0.0, 0.0, "rests"), (0.0, 0.2, "rolls"), (0.2, 0.2, "slides"), (0.2, 0.0, "slides")]
)
def test_lasting_contacts_are_bars_of_their_kind(slip: float, sweep: float, kind: str) -> None:
    steps: list[list[Contacts]] = [[] for _ in range(40)]
    for i in range(10, 30):
        steps[i] = [rows(1, 0, 0.004, slip_m_s=slip, sweep_m_s=sweep, points=1 + i % 4)]
    events = find_leaps(log_of(steps))
    assert (events.bar_kind, list(events.bar_body)) == ((kind,), [1])
    np.testing.assert_allclose(events.bar_s, [[10 * DT, 30 * DT]])
    assert len(events.strike_s) == 1  # the landing


def test_a_blow_on_a_resting_body_is_seen_above_its_weight() -> None:
    steps = [[rows(1, 0, 0.004)] for _ in range(60)]
    steps[30] = [rows(1, 0, 0.1)]
    events = find_leaps(log_of(steps))
    np.testing.assert_allclose(events.strike_s, [0, 30 * DT])
    np.testing.assert_allclose(events.strike_n_s, [0.004, 0.096])


def test_no_contacts_no_events() -> None:
    events = find_leaps(log_of([[], []]))
    assert (len(events.strike_s), len(events.bar_kind)) == (0, 0)


@pytest.mark.parametrize("sr", [8000, 44_100, 96_000])
@pytest.mark.parametrize("amplitude_pa", [1e-3, 1.0])
def test_a_sine_reads_its_sound_pressure_level(sr: int, amplitude_pa: float) -> None:
    sound = amplitude_pa * np.sin(2 * np.pi * 1000 * np.arange(sr) / sr)
    frequency, time_s, level = scene_plot.spectrogram_db(sound, sr)
    middle = level[:, np.argmin(np.abs(time_s - 0.5))]
    assert frequency[middle.argmax()] == pytest.approx(1000, abs=30)
    assert middle.max() == pytest.approx(20 * np.log10(amplitude_pa / np.sqrt(2) / 20e-6), abs=0.3)


def drawn(path: Path, sound: np.ndarray, log: ContactLog | None = None, title: str = "a") -> bytes:
    scene_plot.render_picture(path, sound, SR, log, title)
    return path.read_bytes()


@pytest.mark.slow
def test_pictures_are_pictures_and_equal_input_gives_equal_bytes(tmp_path: Path) -> None:
    sound = np.random.default_rng(0).normal(size=(2, SR // 2))
    log = log_of([[rows(1, 0, 0.1), rows(2, 0, 0.1, slip_m_s=0.1)] for _ in range(120)])
    first = drawn(tmp_path / "a.png", sound, log, "a $ title")
    assert first.startswith(b"\x89PNG")
    assert first == drawn(tmp_path / "b.png", sound, log, "a $ title")
    assert first != drawn(tmp_path / "c.png", sound[:1], log, "a $ title")  # two channels: it says which is shown
    assert drawn(tmp_path / "d.pdf", sound, log).startswith(b"%PDF")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png", "c.png", "d.pdf"]


@pytest.mark.parametrize("frames", [0, 1])
def test_silence_and_the_shortest_sounds_can_be_drawn(tmp_path: Path, frames: int) -> None:
    assert drawn(tmp_path / "a.png", np.zeros((1, frames)), log_of([]))
    assert drawn(tmp_path / "b.png", np.ones((1, frames)))


def test_samples_carry_their_sensor_s_unit() -> None:
    assert scene_plot.quantity(Microphone([0, 0, 1])) == ("pressure", "Pa")
    assert scene_plot.quantity(Vibrometer(0, [0, 0, 0], [0, 0, 1])) == ("velocity", "m/s")
    assert scene_plot.quantity(ModalSum()) == ("modal sum", "1")


def test_more_bodies_than_lanes(tmp_path: Path) -> None:
    many = scene_plot.LANES_MAX + 10
    log = log_of([[rows(i, 0, 0.01) for i in range(1, many)]], bodies=many)
    assert drawn(tmp_path / "a.png", np.zeros((1, 100)), log)


@pytest.mark.parametrize("name", ["a.txt", "a", "none/a.png"])
def test_a_place_that_cannot_be_drawn_to_is_one_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError):
        scene_plot.render_picture(tmp_path / name, np.zeros((1, 100)), SR)


def test_a_picture_of_sound_on_disk_is_that_of_the_same_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spool, "MEMORY_BYTES", 1000)
    monkeypatch.setattr(spool, "BLOCK_BYTES", 1000)
    samples = np.random.default_rng(0).normal(size=(2, 20_000))
    kept = spooled_sound.SoundSpool(2)
    for start in range(0, 20_000, 700):
        kept.add(samples[:, start : start + 700])
    assert kept.on_disk
    for name, sound in {"a": samples, "b": kept.finish()}.items():
        scene_plot.render_picture(tmp_path / f"{name}.png", sound, SR)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_what_cannot_be_drawn_leaves_nothing(tmp_path: Path) -> None:
    for bad in (np.full((1, 10), np.nan), np.zeros(10), np.zeros((0, 10))):
        with pytest.raises(AudioError):
            scene_plot.render_picture(tmp_path / "a.png", bad, SR)
    assert list(tmp_path.iterdir()) == []
