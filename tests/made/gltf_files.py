"""What others say of a glTF: the draft extension's own schemas, and Khronos' validator."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet.files.gltf.gltf_tree import read_tree
from sonic_bullet.records.errors import FileError

AUDIO = "KHR_audio_rigid_bodies"
CORE: dict[str, dict[str, Any]] = {
    "glTFProperty.schema.json": {"type": "object"},
    "glTFChildOfRootProperty.schema.json": {"type": "object", "properties": {"name": {"type": "string"}}},
    "glTFid.schema.json": {"type": "integer", "minimum": 0},
    "material.normalTextureInfo.schema.json": {"type": "object", "required": ["index"]},
}
"""What the extension's schemas take of glTF 2.0's own."""
VALIDATE = """
const path = require('path'), fs = require('fs');
const own = require.resolve('gltf-validator', { paths: [process.argv[2], process.cwd()] });
require(own).validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(
  report => console.log(JSON.stringify(report.issues.messages.filter(m => m.severity < 2))),
  error => { console.log(JSON.stringify([String(error)])); });
"""
REPO = Path(__file__).resolve().parents[2]


def schema_errors(path: Path, folder: Path) -> list[str]:
    """What the extension's schemas find wrong with a document and its nodes."""
    jsonschema = pytest.importorskip("jsonschema")
    referencing = pytest.importorskip("referencing")
    own = {file.name: json.loads(file.read_text()) for file in folder.glob("*.schema.json")}
    if not own:
        pytest.skip("shared data not found: gltf-audio")
    registry = referencing.Registry().with_resources(
        [(name, referencing.Resource.from_contents(one, referencing.jsonschema.DRAFT202012))
         for name, one in {**CORE, **own}.items()]
    )  # fmt: skip
    tree = read_tree(path, FileError, "").tree
    cases = [("glTF.KHR_audio_rigid_bodies.schema.json", tree["extensions"][AUDIO])]
    cases += [
        ("node.KHR_audio_rigid_bodies.schema.json", node["extensions"][AUDIO])
        for node in tree["nodes"]
        if AUDIO in node.get("extensions", {})
    ]
    assert len(cases) > 1
    return [
        error.message
        for name, entry in cases
        for error in jsonschema.Draft202012Validator(own[name], registry=registry).iter_errors(entry)
    ]


def khronos_messages(path: Path) -> list[Any]:
    """Errors and warnings of npm's gltf-validator; skipped where node or that package is not there."""
    if shutil.which("node") is None:
        pytest.skip("no node on PATH")
    words = ["node", "-e", VALIDATE, str(path), str(REPO)]
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=120)
    if "Cannot find module" in done.stderr:
        pytest.skip("no gltf-validator: npm install --no-save gltf-validator")
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout)
    return found
