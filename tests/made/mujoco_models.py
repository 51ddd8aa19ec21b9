"""Small MuJoCo models."""

from __future__ import annotations

from typing import Any

MASS_KG = 0.1
DROPPED = {
    "ball": "<body name='thing' pos='0 0 .1'><freejoint/><geom type='sphere' size='.02' mass='.1'/></body>",
    "box": "<body name='thing' pos='0 0 .1'><freejoint/><geom type='box' size='.02 .03 .04' mass='.1'/></body>",
    "slider": "<body name='thing' pos='0 0 .04'><freejoint/><geom type='box' size='.02 .03 .04' mass='.1'/></body>",
}
PAIR = (
    "<geom name='shelf' type='box' size='.1 .1 .01' pos='0 0 .3'/>"
    "<body name='arm' pos='0 0 1'><joint axis='0 1 0'/><geom type='capsule' size='.02 .1' pos='.1 0 0' euler='0 90 0'/>"
    "<body name='hand' pos='.25 0 0'><joint axis='1 1 0'/><geom type='box' size='.05 .02 .01' pos='.01 .02 .03'/>"
    "</body></body>"
)
ASSETS = (
    "<asset><mesh name='wedge' vertex='0 0 0  .1 0 0  0 .08 0  0 0 .06'/>"
    "<hfield name='hills' nrow='4' ncol='4' size='1 1 .1 .1'/></asset>"
)


def made(bodies: str, integrator: str = "Euler", *, flags: str = "", timestep: float = 0.002) -> tuple[Any, Any]:
    """A model of these bodies above a floor, and its data, thrown where the first body is free."""
    import mujoco

    option = f"<option timestep='{timestep}' integrator='{integrator}'>{flags}</option>"
    floor = "<geom name='floor' type='plane' size='1 1 .1'/>"
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><compiler angle='degree'/>{option}{ASSETS}<worldbody>{floor}{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[:] = [0.3, 0.1, -1, 1, 2, 3][: model.nv] if "pos='0 0 .04'" not in bodies else [0.8, 0.3, 0, 0, 0, 0]
    return model, data


def stepped(model: Any, data: Any, steps: int) -> None:
    """Make steps, one by one."""
    import mujoco

    for _ in range(steps):
        mujoco.mj_step(model, data)
