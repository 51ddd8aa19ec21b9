"""A fitted case -> a page on which its bodies are struck before and after, beside the recordings.

    Prediction (modes of a hypothesis at the body's surface) -> BakedModel, two of each body, of one set of points
    strikes at known places -> clips, each with the place and the direction in which a body is struck as it was

What acts on a force, in the bank or on a sound is not in a body's modes, so not in these strikes: a room, a chain of
measurement, what grows with the level. They stand in the report's own players.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.baking import bake_body, for_page
from sonic_bullet.apps.bake.page.body_page import BODY_SCRIPTS, BODY_TEMPLATE
from sonic_bullet.apps.bake.page.page_data import body_data, clip_data, nearest_point, page_data
from sonic_bullet.apps.report.page.assembly import page_text
from sonic_bullet.files.cases import Case
from sonic_bullet.files.meshes import read_own_vertices
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody, struck_bodies
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.recorded import guess_of
from sonic_bullet.options.bake import PruningOptions
from sonic_bullet.records import Body, ModalModel

STATES = ("before", "after")


def struck_page(
    case: Case, before: Hypothesis, after: Hypothesis, bodies: Iterable[StruckBody], takes: Sequence[AudioObservation]
) -> str:
    """Return the text of a page; empty where no body of the case has a shape that rings.

    Parameters
    ----------
    case
        What was fitted.
    before, after
        What the bodies are struck as.
    bodies
        The case's; those without a shape have no place to be struck at.
    takes
        Recordings from the onset on.

    Raises
    ------
    SonicBulletError
    """
    longest_s = 2.0
    made: list[dict[str, Any]] = []
    clips: list[dict[str, Any]] = []
    for body in (one for one in bodies if one.family is not None):
        models = [bake_prediction(predict(h, body), case) for h in (before, after)]
        numbers = [len(made), len(made) + 1]
        for state, model in zip(STATES, models, strict=True):
            made.append(body_data(model, ()) | {"name": f"{body.name}, {state}", "state": state})
        for take in takes:
            place = body.recordings[take.strike].position_m
            if take.body is not body or place is None:
                continue
            way = body.direction[take.strike] / np.linalg.norm(body.direction[take.strike])
            strike = {
                "bodies": numbers,
                "point": nearest_point(models[0], np.array(place)),
                "direction": way.tolist(),
            }
            clip = clip_data(take.sample[: round(longest_s * take.sr)], take.sr)
            clips.append({"name": take.name, **clip, "strike": strike})
    if not made:
        return ""
    return page_text(BODY_TEMPLATE, BODY_SCRIPTS, title=f"Strike it: {case.name}", data=page_data(made, clips))


def fitted_page(found: CaseFit) -> str:
    """Return the page of a fit: before, of the guessed material; after, of the fitted one. As of `struck_page`."""
    bodies = struck_bodies(found)
    air = 1.0 if found.radiation == "apart" else 0.0
    fitted = {body.name: body.correction for body in bodies}
    after = Hypothesis(found.fit.alpha_per_s, found.fit.beta_s, found.fit.sigma, (), fitted, air=air)
    if not bodies:
        return ""
    guess = guess_of(found.case.objects[bodies[0].name])
    before = replace(
        after,
        alpha_per_s=after.alpha_per_s if guess.alpha_per_s is None else guess.alpha_per_s,
        beta_s=after.beta_s if guess.beta_s is None else guess.beta_s,
        correction=None,
        stretch=float(np.log(guess.youngs_pa / guess.density_kg_m3 / found.fit.gamma_m2_s2) / 2),
        poisson=guess.poisson,
    )
    return struck_page(found.case, before, after, bodies, takes_of(bodies))


def bake_prediction(p: Prediction, case: Case) -> BakedModel:
    """Bake a body as a hypothesis has it, at points of its mesh; its decays are total, with the air's as fitted."""
    body, model, thing = p.body, p.model, case.objects[p.body.name]
    assert thing.mesh is not None
    count = body.surface_count(model)
    vertex, face = read_own_vertices(thing.mesh)
    material = guess_of(thing)
    surface = ModalModel(
        model.freq_hz,
        model.decay_per_s,
        model.shape[:count],
        model.vertex_m[:count],
        model.face,
        np.zeros(len(model.face)),
        model.volume_m3,
        model.mass_kg,
        note=model.note,
        includes_radiation=True,
    )
    made = replace(
        material, alpha_per_s=max(p.hypothesis.alpha_per_s, 0.0), beta_s=max(p.hypothesis.beta_s, 0.0), residual=None
    )
    whole = Body(
        0, -1, 0, body.name, model.mass_kg, np.zeros((3, 3)), volume_m3=model.volume_m3, material=made, model=surface
    )
    return bake_body(whole, for_page(PruningOptions(), len(vertex)), (vertex * thing.scale, face))
