"""A log as a film: poses on their exact times, a camera that sees them, contacts where they are."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.film import FilmLook, make_film, pictures_in
from sonic_bullet.apps.soundtrack.overlay import COLOURS, pixel, shown_at, with_contacts
from sonic_bullet.apps.soundtrack.staging import chosen_camera, duration_of, stage_log
from sonic_bullet.engine.runtime.replay import render_kept
from sonic_bullet.engine.runtime.sound_events import find_sound_events
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import progress_to
from sonic_bullet.records import Body
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError, FileError, RecordError, SceneError
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.pictures import Camera, ColouredMesh, open_pictures, standing_in
from tests.made.films import decoded
from tests.made.models import STEEL, box_body, box_surface
from tests.made.soundtracks import MICROPHONES, table_log
from tests.made.worlds import box, floor

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def moving_log(steps: int = 48, dt_s: float = 1 / 240, teleport: int = -1) -> ContactLog:
    """A box on a straight way at 2 m/s that turns by 3 rad/s about z."""

    def pose(number: int) -> tuple[list[float], list[float]]:
        time_s = number * dt_s
        return [2 * time_s, 0.0, 1.0], [0.0, 0.0, np.sin(1.5 * time_s), np.cos(1.5 * time_s)]

    made = []
    for number in range(steps):
        place, turn = pose(number)
        if 0 <= teleport <= number:
            place[1] = 5.0
        made.append(Step(dt_s, [place], [turn], [number == teleport], Contacts.none()))
    return ContactLog((box_body((0.2, 0.1, 0.05), (800.0,)),), tuple(made), MICROPHONES[:1], 48_000, 0)


@pytest.mark.parametrize("fps", [24, 25, Fraction(30000, 1001), 60, 240, 1000])
def test_poses_are_those_of_the_pictures_times(fps: Fraction) -> None:
    log = moving_log()
    count = pictures_in(log, Fraction(fps))
    found = stage_log(log, Fraction(fps), count)
    time_s = np.arange(count) / float(fps)
    known = time_s <= 47 / 240
    assert found.position_m[known, 0, 0] == pytest.approx(2 * time_s[known], abs=1e-12)
    angle = 2 * np.arctan2(found.quaternion_xyzw[known, 0, 2], found.quaternion_xyzw[known, 0, 3])
    # a chord for an arc: (3/240)² / 8 of it
    assert angle == pytest.approx(3 * time_s[known], abs=1e-5)
    assert np.linalg.norm(found.quaternion_xyzw, axis=2) == pytest.approx(1)
    assert found.shown.all()
    assert found.still.tolist() == [False]


def test_who_is_set_elsewhere_does_not_fly_there() -> None:
    found = stage_log(moving_log(teleport=20), Fraction(1000), 100)
    assert set(found.position_m[:, 0, 1].tolist()) == {0.0, 5.0}


def test_a_body_is_seen_while_it_is_there() -> None:
    log = table_log()
    fps = Fraction(60)
    found = stage_log(log, fps, pictures_in(log, fps))
    column = {log.bodies[i].until_step: k for k, i in enumerate(found.body) if log.bodies[i].until_step >= 0}
    for until, k in column.items():
        assert found.shown[: until // 4, k].all() and not found.shown[until // 4 + 1 :, k].any()
    late = next(k for k, i in enumerate(found.body) if log.bodies[i].since_step == 60 and log.bodies[i].model)
    assert not found.shown[:15, late].any() and found.shown[16:, late].all()
    (note,) = (one for one in found.notes if "not drawn" in one)  # the silent partner, of which the log has no shape
    assert "film the scene, or, of an animation" in note and "a material in the table of score" in note


def test_lengths_are_exact_and_what_is_too_long_is_refused() -> None:
    log = moving_log()
    assert duration_of(log) == Fraction(1, 5)
    assert pictures_in(log, Fraction(25)) == 5
    assert pictures_in(log, Fraction(24)) == 5  # the fifth begins before the end
    assert pictures_in(log, Fraction(24), 0.1) == 3
    with pytest.raises(AudioError, match=r"longer than its sound, 0\.200 s"):
        pictures_in(log, Fraction(24), 0.21)
    with pytest.raises(AudioError, match="no physics step"):
        pictures_in(replace(log, steps=()), Fraction(24))


def coloured_mesh(edges_m: Any = (0.2, 0.2, 0.2), colour: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> ColouredMesh:
    return ColouredMesh(*box_surface(edges_m), colour)


def coloured(picture: Any) -> np.ndarray:
    """(height, width) what is not background."""
    return np.asarray((picture < 250).any(axis=2))


def test_a_point_is_drawn_where_the_projection_says() -> None:
    size, camera = (320, 200), Camera([0.3, -2.0, 1.0], [0.0, 0.0, 0.2], 35)
    drawer = open_pictures([coloured_mesh((0.02,) * 3)], size)
    try:
        for place in ([0.0, 0.0, 0.2], [0.4, 0.3, 0.5], [-0.5, -0.4, 0.1]):
            picture = drawer.picture(np.array([place]), np.array([UPRIGHT]), np.array([True]), camera)
            y, x = np.nonzero(coloured(picture))
            assert (x.mean() + 0.5, y.mean() + 0.5) == pytest.approx(pixel(np.array(place), camera, size), abs=1.0)
        assert not coloured(drawer.picture(np.zeros((1, 3)), np.array([UPRIGHT]), np.array([False]), camera)).any()
    finally:
        drawer.close()
    assert pixel(np.array([0.6, -4.0, 1.8]), camera, size) is None  # behind it


def test_what_stands_still_is_drawn_once_and_the_picture_is_the_same() -> None:
    size, camera = (200, 120), Camera([0.0, -2.0, 1.0], [0.0, 0.0, 0.0])
    edges_and_colours = ((1.0, 0.6, 0.02), (0.5, 0.4, 0.3)), (), ((0.3, 0.1, 0.4), (0, 0, 1))
    meshes = [coloured_mesh(*one) for one in edges_and_colours]
    turned = np.tile(np.array(UPRIGHT), (3, 1))
    one, other = open_pictures(meshes, size), open_pictures(meshes, size, still=np.array([True, False, True]))
    try:
        for x in (-0.6, 0.0, 0.1, 0.4):
            poses = np.array([[0, 0, 0], [x, 0.05, 0.1], [0.2, -0.1, 0.2]])
            pictures = [drawer.picture(poses, turned, np.ones(3, bool), camera) for drawer in (one, other)]
            assert (pictures[0] != pictures[1]).any(axis=2).mean() < 1e-3
    finally:
        one.close()
        other.close()


def test_the_chosen_camera_takes_in_what_moves() -> None:
    log = table_log()
    fps = Fraction(10)
    found = stage_log(log, fps, pictures_in(log, fps))
    camera = chosen_camera(log, found)
    moves = ~found.still
    inside = [
        (at := pixel(place, camera, (1280, 720))) is not None and 0 <= at[0] <= 1280 and 0 <= at[1] <= 720
        for place in found.position_m[:, moves][found.shown[:, moves]]
    ]
    assert len(inside) > 20
    assert np.mean(inside) >= 0.9
    with pytest.raises(RecordError, match="looks at itself"):
        chosen_camera(log, found, (1, 1, 1), (1, 1, 1))


@pytest.mark.slow
def test_a_film_has_its_sound_and_follows(tmp_path: Path) -> None:
    log = table_log()
    look = FilmLook(fps=Fraction(25), size=(160, 90), follow="marble")
    shares: list[float] = []
    sound = render_kept(log)
    with progress_to(fraction=shares.append):
        report = make_film(tmp_path / "x.mov", log, sound, log.sr, look=look, peak_dbfs=-1)
    assert (report.pictures, report.samples, report.clipped, report.channels) == (23, 23 * 1920, 0, 2)
    assert shares == pytest.approx([(k + 1) / 23 for k in range(23)])
    film = decoded(tmp_path / "x.mov")
    assert len(film.picture_s) == 23
    assert np.ptp(film.brightness) > 0
    mix = render_kept(log).samples() * report.gain_per_pa
    assert pytest.approx(mix, abs=2**-22) == film.sound.reshape(-1, 2)[: mix.shape[1]].T
    with pytest.raises(SceneError, match=r"nobody|no body called 'marbel'.*marble"):
        make_film(tmp_path / "y.mov", log, render_kept(log), log.sr, look=replace(look, follow="marbel"))
    assert [one.name for one in tmp_path.iterdir()] == ["x.mov"]


def test_contacts_are_drawn_where_they_are() -> None:
    log = table_log()
    events = find_sound_events(log)
    hit = max((one for one in events if one.kind == "impact"), key=lambda one: one.impulse_n_s)
    camera, size = Camera(hit.place_m + np.array([0.0, -1.0, 0.5]), hit.place_m), (200, 120)
    time_s = hit.start_s + 0.02
    now = shown_at([hit], time_s)
    assert now == [hit]
    assert shown_at([hit], hit.start_s - 0.01) == shown_at([hit], hit.end_s + 1) == []
    blank = np.full((120, 200, 3), 255, np.uint8)
    drawn = with_contacts(blank, now, {}, log, time_s, camera)
    ring = (np.abs(drawn.astype(int) - COLOURS["impact"]).max(axis=2) < 30) & (np.arange(120)[:, None] > 40)
    y, x = np.nonzero(ring)
    assert (x.mean(), y.mean()) == pytest.approx(pixel(hit.place_m, camera, size), abs=1.5)
    assert blank.min() == 255


def test_the_world_tells_the_shapes_that_a_log_has_not() -> None:
    client = direct_client()
    try:
        floor(client)
        box(client, (0.3, 0.2, 0.4))
        found = standing_in(client._client)
        assert len(found) == 2
        assert found[1].position_m == pytest.approx([0.3, 0.2, 0.4])
        assert np.ptp(found[1].mesh.vertex_m, axis=0) == pytest.approx([0.2, 0.1, 0.01])
        assert np.ptp(found[0].mesh.vertex_m, axis=0)[0] > 10
    finally:
        disconnect(client)


def test_nothing_to_draw_is_said(tmp_path: Path) -> None:
    log = replace(moving_log(), bodies=(Body(0, -1, 0, "x", 1.0, np.eye(3), material=STEEL),))
    with pytest.raises(SceneError, match="nothing to draw"):
        make_film(tmp_path / "x.mp4", log, KeptSound.of(np.zeros((1, 9600))), 48_000)
    with pytest.raises(FileError, match="even"):
        make_film(tmp_path / "x.mp4", log, KeptSound.of(np.zeros((1, 9))), 48_000, look=FilmLook(size=(11, 11)))
    assert list(tmp_path.iterdir()) == []
