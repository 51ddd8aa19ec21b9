"""BakedModels -> a page on which they are struck: `bake … -o NAME.html`."""

from __future__ import annotations

import os
from collections.abc import Sequence

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.page.page_data import body_data, page_data, recording_data
from sonic_bullet.apps.bake.page.variants import PAGE_MATERIALS
from sonic_bullet.apps.report.page.assembly import write_page

BODY_TEMPLATE = "body.html.jinja"
BODY_SCRIPTS = ("geometry.js", "variant.js", "sound.js", "stage.js", "view.js", "plots.js", "body_page.js")


def write_body_page(
    path: str | os.PathLike[str],
    models: Sequence[BakedModel],
    coarse: Sequence[BakedModel] | None = None,
    *,
    others: Sequence[str] = (),
    recordings: Sequence[str] = (),
) -> int:
    """Write a page of one or several bodies, whole or not at all; return its size in bytes.

    Parameters
    ----------
    path
        Where.
    models
        What is struck.
    coarse
        The same modes at fewer points each, from which other materials are computed sooner.
    others
        Names or preset files of further materials of the list, the first of it.
    recordings
        Sound files that are played beside the strikes, as loud.

    Raises
    ------
    FileError
        A place that cannot be written.
    ModalError
        Where nothing says how a model radiates.
    """
    title = ", ".join(model.name for model in models[:3]) + (" …" if len(models) > 3 else "")
    materials = tuple(dict.fromkeys((*others, *PAGE_MATERIALS)))
    bodies = [body_data(model, materials, few) for model, few in zip(models, coarse or models, strict=True)]
    data = page_data(bodies, [recording_data(one) for one in recordings])
    return write_page(str(path), BODY_TEMPLATE, BODY_SCRIPTS, title=f"Strike it: {title}", data=data)
