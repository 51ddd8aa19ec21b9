"""Options of `modes`, and of meshes wherever one is read."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.fit import uff_option
from sonic_bullet.options.option import Options, group, option
from sonic_bullet.options.render import json_option


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshOptions(Options):
    """Mesh."""

    scale: float = option(1.0, "Metres per mesh unit: 0.001 for a mesh in millimetres.", metavar="S")
    thickness_m: float | None = option(None, "Wall thickness in m of an open surface.", "--thickness", metavar="T")
    to_hz: float | None = option(None, "All elastic modes up to F.", metavar="F", above=0, unset="20000")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModesOptions(Options):
    """Modes."""

    material: str | None = option(
        None,
        "A name ('sonic-bullet materials') or a preset file.",
        metavar="M",
        unset="steel, if no constants are given",
    )
    youngs_pa: float | None = option(None, "Young's modulus in Pa, in place of the material's.", "--young", metavar="E")
    poisson: float | None = option(None, "Poisson's ratio, in place of the material's.", metavar="N")
    density_kg_m3: float | None = option(
        None, "Density in kg/m³, in place of the material's.", "--density", metavar="R"
    )
    count: int | None = option(None, "The lowest K elastic modes.", metavar="K", least=1, most=1000)
    fixed: tuple[tuple[float, float, float, float], ...] = option(
        (), "Clamp all within R of a point, in m, mesh frame.", "--fix", metavar="X,Y,Z,R"
    )
    accuracy: float = option(0.01, "Relative error allowed at the highest mode.", metavar="A", above=0, most=0.5)
    tail: bool = option(
        False, "Also list the resonators that stand in a scene for a plate's or shell's modes above those."
    )
    uff_to: str | None = uff_option()
    json_to: str | None = json_option()
    output: str | None = option(
        None,
        "Also write the modal model: frequencies, decays, shapes on the surface.",
        "-o",
        "--output",
        metavar="MODEL.npz",
    )
    mesh: MeshOptions = group(MeshOptions)


@dataclass(frozen=True, slots=True, kw_only=True)
class JsonOptions(Options):
    """Options of a command that has no others, such as `materials`."""

    json_to: str | None = json_option()
