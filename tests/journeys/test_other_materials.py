"""`--material [NAME=]M` and `--silent NAME`, for a scene, a script and a log, as a user asks for them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet import scene
from sonic_bullet.files import presets, read_log
from sonic_bullet.records.errors import SceneError
from sonic_bullet.session.material_choice import as_choice
from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.made.lines import line_at

SCENE = """
import pybullet as p

SECONDS = 0.4
MICROPHONE = (0, -0.4, 0.3)


def build(client):
    def box(mass, size, place):
        shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5 * x for x in size])
        return client.createMultiBody(mass, shape, basePosition=place)

    box(0, (0.4, 0.4, 0.02), (0, 0, -0.5))
    bar = box(0.2, (0.16, 0.024, 0.008), (0, 0, 0))
    ball = client.createMultiBody(
        0.004, client.createCollisionShape(p.GEOM_SPHERE, radius=0.005), basePosition=[0.07, 0.008, 0.02]
    )
    client.resetBaseVelocity(ball, [0, 0, -1.0])
    for body in (bar, ball):
        client.changeDynamics(body, -1, restitution=0.8, linearDamping=0, angularDamping=0)
    return {bar: {"material": "steel", "name": "bar"}, ball: {"material": "steel", "name": "ball"}}
"""
SCRIPT = """
import pybullet as p

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
board = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.02])
p.createMultiBody(0, board)
p.loadURDF("bar.urdf", [0, 0, 0.05])
for _ in range(60):
    p.stepSimulation()
"""
URDF = """<robot name="bar"><link name="bar"><inertial><mass value="0.2"/><inertia ixx="1e-5" iyy="4e-4" izz="4e-4"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.16 0.016 0.008"/></geometry></collision></link>
</robot>"""
WITHIN = 0.02


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("materials")
    (folder / "scene.py").write_text(SCENE)
    (folder / "script.py").write_text(SCRIPT)
    (folder / "bar.urdf").write_text(URDF)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "plain.wav", "--contacts", "log.npz", "--pascals", "--tail", 0) == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def heard(source: str, *words: object) -> np.ndarray:
    """The sound of a scene or log in Pa, without a tail; its log is new.npz, its report new.json."""
    more = ("--pascals", "--tail", 0, "--contacts", "new.npz", "--json", "new.json")
    assert run("render", source, "-o", "new.wav", *more, *words) == 0
    return np.asarray(soundfile.read("new.wav")[0])


def made_of(log: str = "new.npz") -> dict[str, str | None]:
    return {body.name: None if body.material is None else body.material.name for body in read_log(log).bodies}


def modes(name: str, log: str = "new.npz") -> np.ndarray:
    """Eigenvalues λ of a body in 1/s²."""
    (model,) = (body.model for body in read_log(log).bodies if body.name == name)
    assert model is not None
    return model.omega0_squared_per_s2


def preset(name: str, **changes: Any) -> str:
    """A preset file, with changes to the groups of one that is there."""
    data = json.loads((presets.TABLES_FOLDER / f"{changes.pop('base', 'steel')}.json").read_text())
    for key, value in changes.items():
        data[key] = {**data[key], **value} if isinstance(value, dict) else value
    Path(name).write_text(json.dumps(data))
    return name


@parametrize_few(
    ("words", "bar", "ball"),
    [
        (("--material", "bar=glass"), "glass", "steel"),
        (("--material", "wood"), "wood", "wood"),
        (("--material", "bar=glass", "--material", "wood"), "glass", "wood"),
        (("--material", "ball=brass", "--material", "bar=wood"), "wood", "brass"),
    ],
    (2, 3),
)
def test_a_scene_and_its_log_are_overridden_alike(words: tuple[str, ...], bar: str, ball: str) -> None:
    """A material moves nothing in PyBullet: the log of steel, replayed in glass, is the scene in glass, bit for bit."""
    from_scene = heard("scene.py", *words)
    assert {"bar": bar, "ball": ball}.items() <= made_of().items()
    from_log = heard("log.npz", *words)
    assert {"bar": bar, "ball": ball}.items() <= made_of().items()
    np.testing.assert_array_equal(from_log, from_scene)
    assert np.abs(from_log - soundfile.read("plain.wav")[0]).max() > 0.01 * np.abs(from_log).max()
    (note,) = (one for one in json.loads(Path("new.json").read_text())["notes"] if "recorded" in one)
    assert "motion, masses and contact forces stay" in note and f"bar is {bar}" in note


@parametrize_few(("youngs", "density"), [(4.0, 1.0), (1.0, 2.0), (0.3, 0.8)], (2,))
def test_frequencies_of_a_log_go_as_the_root_of_stiffness_over_density(youngs: float, density: float) -> None:
    """λ = γ θ(ν)/L², γ = E/ρ, for an isotropic body [Hughes 1987, ch. 2.7]; heard as a line of that frequency."""
    steel = presets.load_material("steel")
    elasticity = {"youngs_pa": steel.youngs_pa * youngs}
    changed = preset("e.json", elasticity=elasticity, density_kg_m3=steel.density_kg_m3 * density)
    sound = heard("log.npz", "--material", f"bar={changed}")
    before, now = modes("bar", "log.npz"), modes("bar")
    count = min(len(before), len(now), 6)
    assert count >= 3
    np.testing.assert_allclose(now[:count] / before[:count], youngs / density, rtol=1e-3)  # both notes say: under 0.1 %
    body = {body.name: body for body in read_log("new.npz").bodies}["bar"]
    assert body.mass_kg == 0.2  # the simulator's
    freq = float(np.sqrt(before[0] * youngs / density)) / (2 * np.pi)
    assert line_at(sound, 48_000, freq, 0.1, 0.3)[0] == pytest.approx(freq, rel=1e-3)


@pytest.mark.parametrize("source", ["scene.py", "log.npz"])
@parametrize_few("law", [{"eta": 4e-3}, {"eta": 1e-3}], 1)
def test_a_preset_with_an_effect_is_honoured(source: str, law: dict[str, float]) -> None:
    """Decays of the played sound are the preset's, d = ηω/2, and those that the log lists."""
    effect = {"id": "damping-law", "law": "constant-loss", **law}
    damping = {"loss_factor": None, "equal_at_hz": None, "alpha_per_s": 1.0, "beta_s": 1e-9, "includes_radiation": True}
    sound = heard(source, "--material", f"bar={preset('d.json', effects=[effect], damping=damping)}", "--no-supports")
    (model,) = (body.model for body in read_log("new.npz").bodies if body.name == "bar")
    assert model is not None
    want = 0.5 * law["eta"] * np.sqrt(model.omega0_squared_per_s2)
    np.testing.assert_allclose(model.decay_per_s, want, rtol=1e-4)
    freq, found, _ = line_at(sound, 48_000, float(model.freq_hz[0]), 0.05, 0.3)
    assert found == pytest.approx(want[0], rel=WITHIN) and freq == pytest.approx(model.freq_hz[0], rel=1e-3)


def test_a_script_takes_names_and_one_for_all(capfd: pytest.CaptureFixture[str]) -> None:
    heard("script.py", "--material", "bar=steel", "--material", "wood")
    assert made_of()["bar"] == "steel" and set(made_of().values()) == {"steel", "wood"}
    assert "every body sounds as wood, but bar as steel" in capfd.readouterr().err


def test_a_script_with_a_listener_of_its_own_is_overridden() -> None:
    Path("own.py").write_text(
        SCRIPT.replace(
            "for _ in",
            "import sonic_bullet as sb\nlistener = sb.attach(p, microphone=(0, -1, 0.5))\n"
            'listener.add_all({0: "wood", 1: {"material": "wood", "name": "beam"}})\nfor _ in',
        ).replace("p.stepSimulation()", "p.stepSimulation()\n    listener.step()")
    )
    heard("own.py", "--material", "beam=steel")
    assert made_of()["beam"] == "steel" and sorted(map(str, made_of().values())) == ["steel", "wood"]


OWN = """
import sonic_bullet as sb
listener = sb.attach(p, microphone=(0, -1, 0.5))
{add}
for _ in range(20):
    p.stepSimulation()
    listener.step()
"""


@pytest.mark.parametrize(
    ("add", "options", "asked", "added"),
    [
        ('listener.add(1, material="wood", name="beam")', ("--material", "body 0=steel"), "body 0", "beam"),
        ('listener.add(0, material="wood")', ("--material", "bar=steel", "--silent", "body 0"), "bar", "body 0"),
        ("", ("--material", "bar=steel"), "bar", "nobody"),
    ],
)
def test_a_name_that_the_scripts_own_listener_never_adds_is_said(
    add: str, options: tuple[str, ...], asked: str, added: str, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("never.py").write_text(SCRIPT.partition("for _ in")[0] + OWN.format(add=add))
    said = error_of(capfd, "render", "never.py", "-o", "no.wav", *options)
    assert f"'{asked}' is given a material, but scene 'never.py' never adds it to its listener" in said
    assert f"add it there, or name who is added: {added}" in said


@parametrize_few("silent", ["bar", "ball"], 1)
def test_a_silent_body_is_left_out_of_the_sound_alone(silent: str) -> None:
    """Scene and log give the same bytes, and what is missing of the mix is that body's stem."""
    from_scene = heard("scene.py", "--silent", silent, "--no-supports")
    from_log = heard("log.npz", "--silent", silent, "--no-supports")
    np.testing.assert_array_equal(from_log, from_scene)
    shutil.rmtree("stems", ignore_errors=True)
    mix = heard("log.npz", "--stems", "stems", "--no-supports")
    (stem,) = (soundfile.read(one)[0] for one in Path("stems").glob(f"*-{silent}.wav"))
    assert np.abs(stem).max() > 0
    np.testing.assert_allclose(from_log + stem, mix, atol=2**-22 * np.abs(mix).max())
    heard("log.npz", "--silent", silent)
    np.testing.assert_array_equal(heard("new.npz"), heard("log.npz", "--silent", silent))  # the log keeps it


def test_who_is_silent_anyway_is_named(capfd: pytest.CaptureFixture[str]) -> None:
    """Of a board to which nobody gave a material, and of a bar that sounds without the option."""
    heard("scene.py", "--silent", "body 0", "--silent", "bar")
    said = capfd.readouterr().err
    assert "'body 0' is silent anyway: silencing it changes nothing" in said and "'bar' is silent" not in said


def test_ground_is_silent_anyway(capfd: pytest.CaptureFixture[str]) -> None:
    Path("grounded.py").write_text(SCRIPT.replace("[0.1, 0.1, 0.02]", "[5, 5, 0.02]"))
    heard("grounded.py")
    assert "body 0 is ground" in (said := capfd.readouterr().err) and "anyway" not in said
    shutil.move("new.npz", "grounded.npz")
    for source in ("grounded.py", "grounded.npz"):
        heard(source, "--silent", "body 0", "--silent", "bar")
        assert "'body 0' is silent anyway" in (said := capfd.readouterr().err) and "'bar' is silent" not in said


def test_all_silent_is_said(capfd: pytest.CaptureFixture[str]) -> None:
    assert not heard("log.npz", "--silent", "bar", "--silent", "ball").any()
    assert "every sounding body that was touched is silenced by --silent" in capfd.readouterr().err


def test_what_the_scene_adds_to_nobody_is_made_to_sound_by_name() -> None:
    assert set(made_of("log.npz")) == {"bar", "ball"}  # nothing touched the floor beneath
    heard("scene.py", "--material", "body 0=wood")
    assert made_of()["body 0"] == "wood"


@pytest.mark.parametrize("who", ['{(arm, "all"): {"material": "wood", "name": "arm"}}', '{(arm, "all"): "wood"}'])
def test_a_name_is_that_of_one_link_or_of_a_whole_body(who: str) -> None:
    link = '<link name="{0}"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" '
    link += 'iyz="0"/></inertial><collision><geometry><box size="{1} 0.02 0.01"/></geometry></collision></link>'
    joint = '<joint name="j" type="fixed"><parent link="base"/><child link="hand"/><origin xyz="0.2 0 0"/></joint>'
    whole = link.format("base", 0.1) + link.format("hand", 0.15) + joint
    Path("arm.urdf").write_text(f'<robot name="arm">{whole}</robot>')
    Path("arm.py").write_text(
        "SECONDS = 0.05\ndef build(client):\n    client.setGravity(0, 0, -9.81)\n"
        f'    arm = client.loadURDF("arm.urdf", [0, 0, 0.1])\n    return {who}\n'
    )
    heard("arm.py", "--material", "arm/hand=steel")
    assert made_of() == {"arm": "wood", "arm/hand": "steel"}
    heard("arm.py", "--material", "arm=brass", "--material", "arm/hand=steel")
    assert made_of() == {"arm": "brass", "arm/hand": "steel"}
    shutil.copy("new.npz", "arm.npz")
    heard("arm.npz", "--material", "arm=glass", "--silent", "arm/hand")
    assert made_of() == {"arm": "glass", "arm/hand": "glass"}
    assert {body.name: body.silent for body in read_log("new.npz").bodies} == {"arm": False, "arm/hand": True}


@pytest.mark.parametrize("source", ["scene.py", "log.npz", "script.py"])
@parametrize_few("option", [("--material", "bowl=steel"), ("--silent", "bowl"), ("--silent", "ba")], 1)
def test_an_unknown_name_lists_those_there_are(
    source: str, option: tuple[str, str], capfd: pytest.CaptureFixture[str]
) -> None:
    said = error_of(capfd, "render", source, "-o", "no.wav", *option)
    assert f"is called '{option[1].split('=')[0]}'" in said and "its bodies are: " in said and "bar" in said
    assert not list(Path().glob("no.*"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--material", "bar=stele"), "stele"),
        (("--material", "bar=none.json"), "none.json"),
        (("--material", "=steel"), "NAME=M"),
        (("--material", "bar="), "NAME=M"),
        (("--material", "wood", "--material", "steel"), "twice"),
        (("--material", "bar=wood", "--material", "bar=steel"), "twice"),
    ],
)
def test_a_wrong_choice_is_one_line_before_anything_runs(
    words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert said in error_of(capfd, "render", "scene.py", "-o", "no.wav", *words)


def test_a_log_that_lacks_a_shape_says_what_to_do(capfd: pytest.CaptureFixture[str]) -> None:
    text = SCENE.replace("(0, 0, -0.5)", "(0, 0, -0.014)")  # the floor carries the bar, and has no material
    Path("partner.py").write_text(text)
    heard("partner.py")
    shutil.copy("new.npz", "partner.npz")
    (floor,) = (name for name, of in made_of("partner.npz").items() if of is None)
    capfd.readouterr()
    said = error_of(capfd, "render", "partner.npz", "-o", "no.wav", "--material", f"{floor}=wood")
    assert floor in said and "does not hold the shape" in said and "render the scene with --material" in said


@pytest.mark.parametrize("name", sorted(one.stem for one in (Path(scene.__file__).parents[1] / "scenes").glob("*.py")))
def test_bodies_of_our_own_scenes_have_names(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a scene returns says what each is called, and nobody's name is one that PyBullet made up."""
    from sonic_bullet.session.scene_file import scene_module
    from sonic_bullet.simulators import direct_client

    cast = scene_module(Path(scene.__file__).parents[1] / "scenes" / f"{name}.py").build(direct_client())
    names = [how["name"] for how in cast.values()]
    assert len(names) == len(set(names)) >= 2
    assert not any(one.startswith(("link", "body")) for one in names)


def test_a_name_with_a_space_is_shown_in_quotes() -> None:
    names = ["body 0", "body 1"]
    with pytest.raises(SceneError, match=r'bodies are: body 0, body 1; quotes hold .* together: "body 1=glass"$'):
        as_choice(materials={"bar": "glass"}).check_names(names, "log.npz")
    with pytest.raises(SceneError, match=r'together: "body 1"$'):
        as_choice(silent=["bar"]).check_names(names, "log.npz")
    with pytest.raises(SceneError, match=r"its bodies are: cup$"):
        as_choice(silent=["bar"]).check_names(["cup"], "log.npz")
