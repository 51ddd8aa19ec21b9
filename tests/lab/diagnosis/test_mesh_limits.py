"""What a coarse mesh gets wrong in its upper modes is told from what the model lacks, and it alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.lab.diagnosis.evidence.mesh_limits import FAR_FOR_MESH, finer_mesh_db, with_unmatched_modes_moved
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import order_modes
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, least_db, mean_db, predict_takes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.stepwise import select_effects
from sonic_bullet.signal.log_spectral import floor_between
from tests.few_cases import parametrize_few
from tests.made.body import SR, plate, recorded, struck, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)


def misjudged(off: np.ndarray, *effects: Effect) -> tuple[StruckBody, Hypothesis, tuple[AudioObservation, ...]]:
    """The plate as its mesh has it, recorded with effects where modes are off (m,) from there, relative; nothing is
    corrected.
    """
    mesh = plate()
    observed = recorded(*effects, model=order_modes(mesh, mesh.freq_hz * (1 + off), mesh.decay_per_s)[0]).recorded
    assert observed is not None and observed.signals is not None
    body = struck(mesh, observed.lines, observed.signals)
    floor = floor_between(list(observed.signals))
    takes = tuple(AudioObservation(body, i, x, SR, floor) for i, x in zip(body.fitted, observed.signals, strict=True))
    h = refit_material(replace(truth(), correction={body.name: np.zeros(mesh.mode_count)}), (body,))
    return body, h, takes


def upper(off: float) -> np.ndarray:
    """Three of the upper modes off, the farther the higher: 2970, 3240 and 3909 Hz, which have no neighbours within 5
    %.
    """
    found = np.zeros(18)
    found[[11, 12, 15]] = np.array([0.7, 0.8, 1.0]) * off
    return found


@parametrize_few("off", [0.022, -0.022], 1)
def test_upper_modes_two_percent_off_are_the_meshs(off: float) -> None:
    body, h, takes = misjudged(upper(off))
    far, most = with_unmatched_modes_moved(h, posed((body,), takes))
    assert far.correction is not None
    assert far.correction[body.name] == pytest.approx(upper(off), abs=2e-4)
    assert most == pytest.approx(abs(off), rel=0.02)
    made = predict_takes(far, takes)
    before, after, floor = mean_db(takes, predict_takes(h, takes)), mean_db(takes, made), least_db(takes, made)
    assert before is not None and after is not None and floor is not None
    assert before - floor > 2.0  # something was open
    assert after - floor < 0.3
    end = select_effects(h, (body,), takes, (), BAND)
    assert end.verdict == "none" and end.mesh_off == most
    assert end.after_db == end.before_db  # what is played knows nothing of it


@parametrize_few(
    "off", [np.r_[np.full(3, 0.02), np.zeros(15)], upper(1.6 * FAR_FOR_MESH)], 1, ids=["low modes", "too far"]
)
def test_what_no_mesh_does_stays_open(off: np.ndarray) -> None:
    """Long waves are what meshes get right; nothing moves by more than FAR_FOR_MESH, or to another pattern's line."""
    body, h, takes = misjudged(off)
    most = with_unmatched_modes_moved(h, posed((body,), takes))[1]
    assert most < FAR_FOR_MESH
    assert select_effects(h, (body,), takes, (), BAND).verdict == "unexplained"


@pytest.mark.parametrize(("reach", "outside"), [(1.02, True), (1.05, False)])
def test_a_mode_below_the_bands_edge_that_nobody_hears_is_the_meshs(reach: float, outside: bool) -> None:
    """Two percent below it may be above; five may not."""
    model = plate()
    shape = model.shape.copy()
    shape[:, :, -1] = 0.0
    observed = recorded(model=replace(model, shape=shape)).recorded
    assert observed is not None and observed.signals is not None
    edge = float(model.freq_hz[-1]) * reach
    body = replace(struck(model, observed.lines, observed.signals), band_hz=(50.0, edge))
    takes = tuple(
        AudioObservation(body, i, x, SR, floor_between(list(observed.signals)))
        for i, x in zip(body.fitted, observed.signals, strict=True)
    )
    h = refit_material(replace(truth(), correction={body.name: np.zeros(model.mode_count)}), (body,))
    far, most = with_unmatched_modes_moved(h, posed((body,), takes))
    assert (most > 0) == outside
    assert not outside or reach - 1 < most < 0.03
    made = predict_takes(far, takes)
    left = mean_db(takes, made) - least_db(takes, made)
    assert (left < 0.3) == outside


@pytest.mark.slow
def test_a_name_is_judged_by_what_a_finer_mesh_would_leave() -> None:
    """More than half of what is open is the mesh's: a name that closes the rest is the right one; not where something
    else is open beside it.
    """
    off, bent = np.where(np.arange(18) == 12, 0.02, 0.0), AmplitudePitch(0.35, "velocity")
    body, h, takes = misjudged(off, bent)
    end = select_effects(h, (body,), takes, (AmplitudePitch,), BAND)
    assert end.verdict == "explained" and [c.id for c in end.added] == ["amplitude-pitch"]
    assert end.mesh_off == pytest.approx(0.02, rel=0.02)
    assert end.after_db - end.floor_db > 0.5 * (end.before_db - end.floor_db)
    body, h, takes = misjudged(off, bent, ContactTime(1e-3, 0.02))
    end = select_effects(h, (body,), takes, (AmplitudePitch,), BAND)
    assert end.verdict == "unexplained" and end.mesh_off == 0.0


def test_nothing_is_put_anywhere_where_every_mode_has_its_line() -> None:
    body, h, takes = misjudged(np.zeros(18))
    far, most = with_unmatched_modes_moved(h, posed((body,), takes))
    assert most == 0.0 and far is h
    assert select_effects(h, (body,), takes, (), BAND).verdict == "none"


def test_modes_of_another_tensor_are_no_coarse_meshs() -> None:
    """A tensor's modes are as many as its own solve gives: none is paired with a line of the bare body's."""
    body, h, takes = misjudged(np.zeros(18))
    h = replace(h, correction={body.name: np.zeros(20)})
    assert with_unmatched_modes_moved(h, posed((body,), takes)) == (h, 0.0)
    assert not finer_mesh_db(h, posed((body,), takes)).any()
