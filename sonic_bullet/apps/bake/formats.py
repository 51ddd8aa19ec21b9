"""Formats of baked files, by a name's ending.

.glb .gltf .json    any number of models, read back by `read_baked`
.html               any number of models, a page on which they are struck
.dsp .h .wav        one model, for playback
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records.coerce import as_path, nearest, quote
from sonic_bullet.records.errors import FileError

SEVERAL_MODELS = (".glb", ".gltf", ".json")
PAGE = ".html"
ONE_MODEL = (".dsp", ".h", ".wav")


def check_baked_name(path: str | os.PathLike[str]) -> str:
    """Check that a name has the ending of a baked model, and return it. Raises FileError."""
    end = Path(as_path(path, "path", "name a file, such as bowl.glb")).suffix.lower()
    known = (*SEVERAL_MODELS, PAGE, *ONE_MODEL)
    if end not in known:
        raise FileError(f"cannot bake to {path}: {quote(end)} is no format known here", nearest(end, known))
    return end


def write_baked(path: str | os.PathLike[str], models: Sequence[BakedModel]) -> None:
    """Write baked models.

    Parameters
    ----------
    path : path
        Its end chooses the format: .glb .gltf .json .html, or of one model .dsp .h.
    models : sequence of BakedModel

    Raises
    ------
    FileError
        An end that is not known, several models where a format holds one, a place that cannot be written.
    ModalError
        Where a format needs radiation and nothing says how the model radiates.
    """
    end = check_baked_name(path)
    if not models or (len(models) > 1 and end in ONE_MODEL):
        names = ", ".join(quote(model.name) for model in models[:8]) or "none"
        raise FileError(f"cannot bake {len(models)} bodies to {path}: {end} holds one", f"name one of {names}")
    if end == ".json":
        from sonic_bullet.apps.bake.json_models import write_json_models

        write_json_models(path, models)
    elif end == PAGE:
        from sonic_bullet.apps.bake.page.body_page import write_body_page

        write_body_page(path, models)
    elif end == ".dsp":
        from sonic_bullet.apps.bake.faust_bank import write_faust_bank

        write_faust_bank(path, models[0])
    elif end == ".h":
        from sonic_bullet.apps.bake.c_bank import write_c_bank

        write_c_bank(path, models[0])
    elif end == ".wav":
        raise FileError(f"cannot bake {path}: a strike is sound", "render it with render_strike and write_audio")
    else:
        from sonic_bullet.apps.bake.gltf_models import write_gltf_models

        write_gltf_models(path, models)


def read_baked(path: str | os.PathLike[str]) -> tuple[BakedModel, ...]:
    """Read baked models.

    Parameters
    ----------
    path : path
        A .json that `bake` wrote, or a .glb or .gltf with KHR_audio_rigid_bodies, of any origin.

    Returns
    -------
    tuple of BakedModel
        In the file's order.

    Raises
    ------
    FileError, RecordError
        One line that names what does not fit.
    """
    end = Path(as_path(path, "path", "name a file, such as bowl.glb")).suffix.lower()
    if end not in SEVERAL_MODELS:
        raise FileError(f"cannot read {path} as a baked model", f"give a file that ends in {', '.join(SEVERAL_MODELS)}")
    with reading_file(path, "baked model", FileError, "bake it again"):
        if end == ".json":
            from sonic_bullet.apps.bake.json_models import read_json_models

            return read_json_models(path)
        from sonic_bullet.apps.bake.gltf_models import read_gltf_models

        return read_gltf_models(path)
