"""Run `bake`: check places, compute modes, write the file, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import (
    clean_stdout,
    places,
    print_report,
    progress_bar,
    quiet_stderr,
    status,
    warn,
    warn_of_assumed_wall,
    write_json,
)
from sonic_bullet.apps.cli.scenes.scene_runs import checked_scene, is_log
from sonic_bullet.apps.cli.solids.scene_outputs import write_whole_scene
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.bake import BakeOptions, PruningOptions, TapOptions
from sonic_bullet.options.modes import MeshOptions
from sonic_bullet.options.option import given_flags, keywords
from sonic_bullet.options.render import SceneOptions
from sonic_bullet.records import Body
from sonic_bullet.records.coerce import LISTED, nearest
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, MaterialError
from sonic_bullet.records.file_endings import GLTF_ENDINGS

if TYPE_CHECKING:
    from sonic_bullet.apps.bake import BakedModel
    from sonic_bullet.files import ContactLog
    from sonic_bullet.session import Listener


def _check_tap(tap: TapOptions, end: str) -> None:
    """Raise FileError where a strike is described for a file that holds none."""
    asked = given_flags(tap)
    if asked and end != ".wav":
        raise FileError(f"{asked[0]} is of a strike, and {end} holds none", "end the name with .wav")


def _write_tap(tap: TapOptions, path: str, model: BakedModel) -> str:
    """Write the strike; return its description."""
    strike_rate_hz, longest_strike_s, strike_fall = 48_000, 10.0, 6.9  # Values of a .wav: e^-6.9 is -60 dB
    import numpy as np

    from sonic_bullet.apps.bake import choose_strike, render_strike
    from sonic_bullet.apps.bake.strike_playback import TAP_CONTACT_S, TAP_IMPULSE_N_S
    from sonic_bullet.files import write_audio

    strike = choose_strike(
        model,
        point_m=None if tap.strike is None else np.array(tap.strike),
        direction=None if tap.direction is None else np.array(tap.direction),
        impulse_n_s=tap.impulse or TAP_IMPULSE_N_S,
        contact_s=TAP_CONTACT_S if tap.contact_ms is None else tap.contact_ms / 1000,
    )
    slowest = float(model.decay_per_s[model.freq_hz < strike_rate_hz / 2].min(initial=np.inf))
    seconds = min(longest_strike_s, strike.contact_s + strike_fall / max(slowest, 1e-3)) or longest_strike_s
    sound = render_strike(model, strike, strike_rate_hz, seconds)
    report = write_audio(path, sound[None], strike_rate_hz, peak_dbfs=-1)
    at = ", ".join(f"{1e3 * x:.4g}" for x in strike.point_m)
    size = float(np.linalg.norm(strike.impulse_n_s))
    return f"a strike of {size:.3g} N·s at ({at}) mm: peak {report.peak_pa:.3g} Pa at 1 m, its modes alone"


def run_bake(sources: tuple[str, ...], options: BakeOptions) -> None:
    """Run `bake`; raises SonicBulletError."""
    from sonic_bullet.apps.bake.formats import ONE_MODEL, PAGE, check_baked_name

    end, source, pruning = check_baked_name(options.output), sources[0], options.pruning
    _check_tap(options.tap, end)
    _check_page(end, options.others, options.recordings)
    to, json_to = places(options.output, options.json_to)
    assert to is not None
    scene = any(is_log(one) or Path(one).suffix.lower() == ".py" for one in sources)
    _check_several(sources, end, scene=scene)
    whole = scene and end in GLTF_ENDINGS and options.body is None
    _check_kind(source, options, scene=scene, whole=whole)
    asked = SceneOptions.from_words(material=options.material if scene else (), client=options.client)
    materials = checked_scene(asked)
    notes: tuple[str, ...] | None = None
    programs, few_points = (".dsp", ".h"), 64  # default number of points of programs, whose tables a compiler reads
    with clean_stdout(json_to) as echo:
        from sonic_bullet.apps.bake import write_baked

        if pruning.points is None and end in programs:
            pruning = replace(pruning, points=few_points)
        more, coarse = "", None
        if whole:
            models, more, notes = write_whole_scene(
                to, source, materials, pruning, options.seconds, emitters=options.emitters
            )
        elif scene:
            models = _scene_models(source, materials, options.body, pruning, one=end in ONE_MODEL, page=end == PAGE)
        else:
            models, coarse = _mesh_models(sources, options.material, options.mesh, pruning, page=end == PAGE)
        if end == ".wav":
            more = _write_tap(options.tap, to, models[0])
        elif end == PAGE:
            _write_page(to, models, coarse or models, others=options.others, recordings=options.recordings)
        elif not whole:
            write_baked(to, models)
        report = BakeReport(options.output, models, more, notes)
        print_report(report, echo)
        pruned = [f"{model.name}: {note}" for model in models for note in model.notes if "--points" in note]
        warn([*pruned, *(notes or ())])
        if not scene:
            _warn_of_walls(sources, models)
    write_json(json_to, report.to_json())


def _check_kind(source: str, options: BakeOptions, *, scene: bool, whole: bool) -> None:
    """Raise FileError for an option that meshes, scenes or whole scenes do not have."""
    if scene and options.mesh != MeshOptions():
        raise FileError(
            "--scale, --thickness and --to-hz are of a mesh", f"leave them out: {source} says what its bodies are"
        )
    for flag, told in (("--body", options.body), ("--client", options.client)):
        if not scene and told is not None:
            raise FileError(f"{flag} is of a scene or a contact log", "leave it out: a mesh is one body")
    for flag, given, what in (("--seconds", options.seconds, "motion"), ("--emitters", options.emitters, "clips")):
        if given and not whole:
            raise FileError(f"{flag} is of a scene or log as .glb or .gltf", f"leave it out: nothing else holds {what}")


def _own_vertex_count(mesh: str) -> int:
    from sonic_bullet.files.meshes import read_own_vertices

    return len(read_own_vertices(Path(mesh))[0])


def _warn_of_walls(meshes: tuple[str, ...], models: list[BakedModel]) -> None:
    for mesh, model in zip(meshes, models, strict=True):
        warn_of_assumed_wall(mesh, model.assumed_wall_m)


def _check_page(end: str, others: tuple[str, ...], recordings: tuple[str, ...]) -> None:
    """Raise FileError where options of a page are given for something else, or as load_material and read_audio do."""
    for option, given in (("--other", others), ("--recording", recordings)):
        if given and end != ".html":
            raise FileError(f"{option} is of a page, and {end} is none", "end the name with .html")
    from sonic_bullet.files.presets import load_material
    from sonic_bullet.files.recordings import read_audio_scale

    for name in others:
        load_material(name)
    for name in recordings:
        read_audio_scale(name)


def _write_page(to: str, models: list[BakedModel], coarse: list[BakedModel], **chosen: tuple[str, ...]) -> None:
    from sonic_bullet.apps.bake.page.body_page import write_body_page

    with status(to):
        write_body_page(to, models, coarse, **chosen)


def _mesh_models(
    meshes: tuple[str, ...],
    material: tuple[str, ...],
    shape: MeshOptions,
    pruning: PruningOptions,
    *,
    page: bool,
) -> tuple[list[BakedModel], list[BakedModel]]:
    """Return the models of meshes, and for a page the same at fewer points."""
    from sonic_bullet.apps.bake.baking import for_page

    few_points = 64  # a mesh of fewer says too little of where its modes move

    models, coarse = [], []
    for mesh, made in zip(meshes, _materials_of(meshes, material), strict=True):
        count = _own_vertex_count(mesh) if page else 0
        fine = for_page(pruning, count) if page else pruning
        models.append(_mesh_model(mesh, made, shape, fine))
        sooner = page and fine != pruning and few_points <= count < len(models[-1].point_m)
        coarse.append(_mesh_model(mesh, made, shape, pruning) if sooner else models[-1])
    return models, coarse


def _check_several(sources: tuple[str, ...], end: str, *, scene: bool) -> None:
    """Raise FileError where several sources do not go into one file."""
    from sonic_bullet.apps.bake.formats import ONE_MODEL

    if len(sources) == 1:
        return
    if scene:
        raise FileError("several sources are meshes, and one is a scene or a log", "bake that alone: it has its bodies")
    if end in ONE_MODEL:
        raise FileError(f"cannot bake {len(sources)} meshes to {end}: it holds one", "name one of them")
    names = [Path(one).stem for one in sources]
    for name in names:
        if names.count(name) > 1:
            raise FileError(f"two meshes are called '{name}'", "rename one of them")


def _materials_of(meshes: tuple[str, ...], given: tuple[str, ...]) -> list[str]:
    """Return the name or file of each mesh's material: of NAME=M that of its own name, else that of all, else steel."""
    usual, own = "steel", dict[str, str]()
    names = [Path(mesh).stem for mesh in meshes]
    named = [one for one in given if "=" in one and not Path(one).is_file()]
    if len(meshes) == 1 and (named or len(given) > 1):
        raise MaterialError("a mesh is of one material", "give --material M once")
    for one in given:
        name, _, material = one.partition("=")
        if one not in named:
            usual = one
        elif name in names:
            own[name] = material
        else:
            raise MaterialError(f"no mesh is called '{name}'", nearest(name, names))
    return [own.get(name, usual) for name in names]


def _mesh_model(mesh: str, material: str, shape: MeshOptions, pruning: PruningOptions) -> BakedModel:
    from sonic_bullet.apps.bake import bake_mesh
    from sonic_bullet.files.presets import load_material

    made = load_material(material)
    with status(mesh):
        return bake_mesh(mesh, made, **keywords(shape), pruning=pruning)


def _scene_models(
    source: str, materials: SceneOptions, name: str | None, pruning: PruningOptions, *, one: bool, page: bool
) -> list[BakedModel]:
    """Return the models of a scene's or log's bodies with modes, each once.

    one: the format holds a single body; page: it is a page.
    """
    scene_s = 0.1  # length of the run that finds a scene's bodies
    from sonic_bullet.apps.bake.baking import bake_body, for_page

    log = scene_log(source, materials, scene_s)
    bodies: dict[str, Body] = {}
    for body in log.bodies:
        if body.model is not None and body.model.mode_count and body.material is not None:
            bodies.setdefault(body.name, body)
    if not bodies:
        raise FileError(f"no body of {source} has modes", "give one a material that rings")
    if name is not None:
        if name not in bodies:
            raise FileError(f"{source} has no body '{name}' with modes", nearest(name, list(bodies)))
        bodies = {name: bodies[name]}
    if one and len(bodies) > 1:
        raise FileError(
            f"{source} has {len(bodies)} bodies with modes, and that format holds one",
            f"give --body with one of {', '.join(list(bodies)[:LISTED])}",
        )
    with status(source):
        made = []
        for body in bodies.values():
            report_progress(body.name)
            assert body.model is not None
            made.append(bake_body(body, for_page(pruning, len(body.model.vertex_m)) if page else pruning))
    return made


def scene_log(
    source: str,
    materials: SceneOptions,
    seconds: float | None,
    at_start: Callable[[Listener], object] | None = None,
    at_end: Callable[[Listener], object] | None = None,
) -> ContactLog:
    """Return a log as it is to be baked, or that of a scene's first seconds, run without sound.

    seconds None: the scene's own. at_start, at_end: called with its listener before the first step, after the last.
    """
    if is_log(source):
        from sonic_bullet.files import read_log
        from sonic_bullet.session.chosen_in_log import with_choice
        from sonic_bullet.session.material_choice import choice_of

        with status(source):
            return with_choice(read_log(source), choice_of(materials), source)[0]

    def with_all_modes(listener: Listener) -> None:
        listener.solve_all()  # who is baked may be struck elsewhere, though nothing touches it here
        if at_end is not None:
            at_end(listener)

    with progress_bar(Path(source).name):
        with quiet_stderr():
            from sonic_bullet.scene import render_scene

        asked = keywords(replace(materials, seconds=seconds, microphones=()))
        return render_scene(source, **asked, at_start=at_start, at_end=with_all_modes).log


@dataclass(frozen=True, slots=True)
class BakeReport:
    """Report of what was baked. more: a line of the file; notes: of a whole scene, None for another file."""

    output: str
    models: list[BakedModel]
    more: str = ""
    notes: tuple[str, ...] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return each body's modes, and the notes."""
        bodies = [
            {
                "name": model.name,
                "material": model.material.name,
                "mass_kg": None if model.mass is None else model.mass.mass_kg,
                "points": len(model.point_m),
                "modes": [
                    {"freq_hz": float(f), "decay_per_s": float(d)}
                    for f, d in zip(model.freq_hz, model.decay_per_s, strict=True)
                ],
                "notes": list(model.notes),
            }
            for model in self.models
        ]
        return {"output": self.output, "bodies": bodies} | ({} if self.notes is None else {"notes": list(self.notes)})

    def lines(self) -> list[str]:
        """Describe each body, and the file, in a line."""
        said = []
        for model in self.models:
            low, high = model.freq_hz.min(), model.freq_hz.max()
            weight = "" if model.mass is None else f", {model.mass.mass_kg:.4g} kg"
            said.append(
                f"{model.name}: {model.material.name}{weight}, {format_count(model.mode_count, 'mode')} "
                f"from {low:.0f} to {high:.0f} Hz at {len(model.point_m)} points"
            )
        return [*said, *([self.more] if self.more else [])]
