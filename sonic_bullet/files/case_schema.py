"""Descriptions of the fields of case.json, and the JSON Schema made of them and of the classes that read the file.

    CaseFields (case_fields.py) -> msgspec's schema + descriptions -> JSON Schema
    -> `sonic-bullet case schema`, docs/reference/case.md

A field without a description here is an error, so that the page stays complete.
"""

from __future__ import annotations

from typing import Any

import msgspec

from sonic_bullet.files.case_fields import CaseFields
from sonic_bullet.files.cases import CASE_FORMAT
from sonic_bullet.files.storage.json_text import json_bytes


def case_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of case.json.

    Raises
    ------
    KeyError
        A field has no description.
    """
    # description of each part of the file and of its fields
    case_parts = {
        "Case": (
            "A case: recorded strikes of known objects. What is not declared is null or absent.",
            {
                "format": "`sonic-bullet-case/1`",
                "recordings": "at least one",
                "objects": "by name",
                "case": "a name; absent: the folder's",
                "support": "clamps, or words",
                "sensor": "one for all recordings",
                "band_hz": "Hz, what the recordings hold; absent: 20 to 20 000",
                "medium": "`air`, `none` where nothing takes sound away, or `unknown`; absent: air for a microphone "
                "or a vibrometer",
                "dimension_tolerance": "of its objects that do not say their own; absent: 0.005",
                "states": "numbers of states by name, as litres filled in, in the order of the states",
                "onset": "arrival of the impulse in every file: s, or words with `sample 0`; absent: found, phases not "
                "used",
                "response_hz": "Hz, from where to where frequency responses were measured: then each file is one "
                "period of a response to an impulse at sample 0, their inverse transform, as `case new` makes of UFF "
                "files; absent: they are recordings",
            },
        ),
        "Recording": (
            "One strike, as an audio file or as a list of measured resonances.",
            {
                "file": "audio file inside the folder",
                "features": "measured resonances, in place of a file",
                "object": "name of a listed object; may be left out where there is one",
                "split": "`fit`, `holdout` or `transfer`; only `fit` is opened before a verdict stands",
                "strike": "where and how hard",
                "channel": "of the file, from 0; absent: the first that is not dead, and a line says so",
                "state": "name of the state that the object was in, where it was recorded in several: `states` says "
                "what changed",
            },
        ),
        "Line": (
            "A measured resonance: freq_hz, and what else was measured of it.",
            {
                "freq_hz": "Hz, above zero",
                "decay_per_s": "d in e^(−dt), 1/s",
                "freq_sd_hz": "standard error, Hz; absent: 10⁻⁴ of the frequency",
                "decay_sd_per_s": "standard error, 1/s; absent: 5 % of the decay",
                "amplitude": "at the onset, any unit",
            },
        ),
        "Strike": (
            "Where and how hard an object was struck.",
            {
                "position": "m, mesh frame, on the surface",
                "direction": "of the impulse, any length; absent: into the surface",
                "impulse": "N·s, above zero; without any, σ stands for gain times impulse",
                "force": "its recorded force",
            },
        ),
        "Force": (
            "The force of an instrumented hammer.",
            {
                "file": "audio file inside the folder",
                "channel": "from 0",
                "newton_per_unit": "N per unit of the file",
            },
        ),
        "Object": (
            "One object: its shape and what it is guessed to be made of.",
            {
                "mesh": "file inside the folder, any mesh that trimesh reads; without it nothing is known of the shape",
                "units": "of the mesh: m, cm or mm",
                "material": "a name that `sonic-bullet materials` lists, as a guess",
                "elastic_guess": "in SI units, good to 30 %",
                "dimension_tolerance": "of the mesh's dimensions, relative, one standard deviation, 0 to 0.2; absent: "
                "the case's. It enters the spread of E/ρ twice, and that of ν",
            },
        ),
        "Elastic": (
            "Guessed constants; what is absent is the named material's.",
            {
                "youngs_modulus": "Pa",
                "density": "kg/m³; a fit cannot tell it from E, so it stays as given",
                "poisson_ratio": "between -1 and 0.5",
            },
        ),
        "Support": (
            "How the objects were held.",
            {
                "fixed": "clamps; none: the objects are free",
            },
        ),
        "Fixed": (
            "A clamp: all vertices within a radius of a point stand still.",
            {
                "position": "m, mesh frame",
                "radius": "m",
                "object": "whose; absent: every object's",
            },
        ),
        "Sensor": (
            "What recorded the strikes. Places and directions are one for all objects, or one for each by its name.",
            {
                "type": "in words; read where `response` says nothing",
                "response": "`velocity` of a surface, `pressure` or `sum of modes`, as a word in any text; else "
                "unknown",
                "position": "m, mesh frame: where a surface's velocity was measured",
                "direction": "along which; absent: out of the surface",
            },
        ),
    }
    made = msgspec.json.schema(CaseFields)
    text = json_bytes(made).decode()
    for name in made["$defs"]:  # the classes have the names of the schema's parts with a suffix
        text = text.replace(f'"#/$defs/{name}"', f'"#/$defs/{_public(name)}"').replace(
            f'"title":"{name}"', f'"title":"{_public(name)}"'
        )
    whole: dict[str, Any] = msgspec.json.decode(text)
    parts = {_public(name): part for name, part in whole["$defs"].items()}
    for name, part in parts.items():
        what, fields = case_parts[name]
        part["description"] = what
        part["properties"] = {
            field: {"description": fields[field], **form} for field, form in part["properties"].items()
        }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": CASE_FORMAT, **whole, "$defs": parts}


def _public(name: str) -> str:
    return name.removesuffix("Fields")
