"""Links by name, and all links of a body: all of them or none, what cannot be filled first, and a line that says which
is being computed.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sonic_bullet as sb
from sonic_bullet import modal
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records.errors import MeshError, ModalError, SceneError
from tests.made.models import STEEL
from tests.made.worlds import plate_model

SHEET = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nf 1 2 3\nf 1 3 4\n"
LINK = """  <link name="{name}"><inertial><mass value="1"/>\
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry>{geometry}</geometry></collision></link>
"""
JOINT = (
    '  <joint name="{name}_joint" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
    '<origin xyz="0 0 {z}"/></joint>\n'
)
ARM = '<box size="0.3 0.03 0.01"/>'


def robot(client: Any, folder: Path, **links: str) -> int:
    """A chain of links with these geometries."""
    names = list(links)
    text = "".join(LINK.format(name=name, geometry=geometry) for name, geometry in links.items())
    text += "".join(JOINT.format(name=name, parent=names[i], z=i + 1) for i, name in enumerate(names[1:]))
    (folder / "robot.urdf").write_text(f'<robot name="crane">\n{text}</robot>')
    return int(client.loadURDF(str(folder / "robot.urdf")))


def boxes(client: Any, folder: Path, tip: str = ARM) -> int:
    return robot(client, folder, foot='<box size="0.2 0.2 0.02"/>', arm=ARM, tip=tip)


class Solver:
    """In place of `modal.analyse`: the same plate for every body, slowly where asked, or the error that a body is meant
    to end in. Nothing is solved side by side beforehand, where not asked.
    """

    def __init__(self, fails_at_m: float = -1.0, pause_s: float = 0.0) -> None:
        self.fails_at_m, self.pause_s = fails_at_m, pause_s
        self.solved_m: list[float] = []

    def __call__(self, shapes: tuple[sb.Shape, ...], *_: Any, **__: Any) -> sb.ModalModel:
        report_progress("filling")
        time.sleep(self.pause_s)
        size_m = round(float(shapes[0].size_m.max()), 6)
        if size_m == self.fails_at_m:
            raise ModalError("the clamps hold the whole body", "give a smaller radius")
        self.solved_m.append(size_m)
        return plate_model()


@pytest.fixture
def solver(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Solver]:
    def put(*, beforehand: bool = False, **how: float) -> Solver:
        made = Solver(**how)
        monkeypatch.setattr(modal, "analyse", made)
        if not beforehand:
            monkeypatch.setattr(modal, "missing_name", lambda *_: None)
        return made

    return put


@pytest.mark.parametrize(("link", "number"), [("foot", -1), ("arm", 0), ("tip", 1), (1, 1), (-1, -1)])
def test_a_link_is_named(client: Any, tmp_path: Path, link: int | str, number: int) -> None:
    body = boxes(client, tmp_path)
    listener = sb.attach(client, microphone=())
    assert listener.add(body, link, material=STEEL, model=plate_model()) == (listener.world.bodies[0].model,)
    assert [(b.body_id, b.link) for b in listener.world.bodies] == [(body, number)]


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ("arn", "did you mean arm"),
        ("TIP", "did you mean tip"),
        ("wheel", "one of foot, arm, tip"),
        ("0", "foot, arm, tip"),
    ],
)
def test_an_unknown_link_lists_the_nearest_names(client: Any, tmp_path: Path, link: str, words: str) -> None:
    body = boxes(client, tmp_path)
    with pytest.raises(SceneError, match=words) as error:
        sb.attach(client, microphone=()).add(body, link, material=STEEL, model=plate_model())
    assert repr(link) in str(error.value)


def test_all_links_are_added_with_a_model_each(client: Any, tmp_path: Path) -> None:
    body = boxes(client, tmp_path)
    listener = sb.attach(client, microphone=())
    models = listener.add(body, link="all", material=STEEL, count=3)
    assert [b.name for b in listener.world.bodies] == ["crane", "crane/arm", "crane/tip"]
    assert all(b.model is not None and b.model.unsolved and len(b.model.face) for b in listener.contacts.bodies)
    assert list(models) == [b.model for b in listener.contacts.bodies]  # each is solved as it is read
    assert models[1] is models[2]  # equal links share one model
    assert models[0].freq_hz[0] != models[1].freq_hz[0]


def test_a_link_that_cannot_be_filled_fails_before_anything_is_solved(
    client: Any, tmp_path: Path, solver: Callable[..., Solver]
) -> None:
    """The first two links would do; the third is a sheet without a wall.

    Nothing is added, the link and the body are named, and the remedies exist.
    """
    (tmp_path / "sheet.obj").write_text(SHEET)
    body = boxes(client, tmp_path, tip=f'<mesh filename="{tmp_path}/sheet.obj"/>')
    listener, made = sb.attach(client, microphone=()), solver(beforehand=True)
    with pytest.raises(MeshError, match="crane/tip") as error:
        listener.add(body, link="all", material=STEEL)
    said = str(error.value)
    assert f"body {body}" in said
    assert "mesh=" in said
    assert "thickness_m" in said
    assert not made.solved_m
    assert not listener.world.bodies
    solver()
    listener.add(body, link="all", material=STEEL, thickness_m=0.002)  # the remedy that it names
    assert len(listener.world.bodies) == 3


def test_a_link_whose_modes_fail_is_named_when_it_is_solved(
    client: Any, tmp_path: Path, solver: Callable[..., Solver]
) -> None:
    """What cannot be seen beforehand."""
    body = boxes(client, tmp_path, tip='<box size="0.02 0.01 0.002"/>')
    listener, made = sb.attach(client, microphone=()), solver(fails_at_m=0.02)
    models = listener.add(body, link="all", material=STEEL)
    assert models[0].mode_count and made.solved_m == [0.2]
    for _ in range(2):  # as often as it is asked for
        with pytest.raises(ModalError, match="crane/tip") as error:
            listener.solve_all()
        assert "mesh=" in error.value.remedy
    with pytest.raises(ModalError, match="crane/tip"):
        list(models)
    assert made.solved_m.count(0.2) == 1


def test_a_link_that_may_have_no_modes_clicks(client: Any, tmp_path: Path, solver: Callable[..., Solver]) -> None:
    body = boxes(client, tmp_path, tip='<box size="0.02 0.01 0.002"/>')
    listener = sb.attach(client, microphone=())
    solver(fails_at_m=0.02)
    listener.add_all({(body, "all"): STEEL}, optional=True)
    listener.solve_all()
    assert [b.model is not None and b.model.mode_count for b in listener.contacts.bodies] == [4, 4, 0]
    (note,) = listener.left_out
    assert note.startswith("crane/tip (body 0) clicks but does not ring: the clamps hold the whole body")


def test_what_the_cache_lacks_is_solved_beforehand_each_once(
    client: Any, tmp_path: Path, solver: Callable[..., Solver], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order of their loudness; equal links once. What fails there fails again, by name, in the second pass."""
    from sonic_bullet.session import body_requests

    body = boxes(client, tmp_path, tip=f'<mesh filename="{Path(__file__).parents[2] / "assets" / "bowl.obj"}"/>')
    (tmp_path / "twins").mkdir()
    twins, seen = robot(client, tmp_path / "twins", foot=ARM, arm=ARM), []
    made, before = solver(beforehand=True, fails_at_m=0.2), []

    def one_by_one(work: Callable[[Any], Any], items: list[Any]) -> list[Any]:
        models = [work(item) for item in items]
        before.extend(made.solved_m)
        return models

    monkeypatch.setattr(body_requests, "parallel_map", one_by_one)
    listener = sb.attach(client, microphone=())
    listener.add_all({(twins, "all"): STEEL, (body, "all"): STEEL}, progress=seen.append)
    with pytest.raises(ModalError, match="clamps"):
        listener.solve_all()
    assert before == [0.3, 0]
    names = [line.split(" (")[0] for line in seen if "two at a time" in line]
    assert names == ["modes of crane", "modes of crane", "modes of crane/tip"]


def test_an_absurd_mass_of_one_link_leaves_nothing_added(client: Any, tmp_path: Path) -> None:
    body = boxes(client, tmp_path)
    client.changeDynamics(body, 1, mass=1e300)
    listener = sb.attach(client, microphone=())
    with pytest.raises(SceneError, match="mass"):
        listener.add(body, link="all", material=STEEL, model=plate_model())
    assert not listener.world.bodies


def test_no_remedy_names_an_option_that_is_none(client: Any) -> None:
    """`edge_m` is an option of the solver's own, not of `Listener.add` or of `sonic-bullet modes`."""
    package = Path(sb.__file__).parent
    remedies = [
        line
        for path in package.rglob("*.py")
        for line in path.read_text().splitlines()
        if "Error(" in line and "edge_m" in line
    ]
    assert [line.strip() for line in remedies if "edge_m is" not in line] == []
    assert len(remedies) == 1


def test_all_links_of_a_body_without_shapes(client: Any) -> None:
    body = client.createMultiBody(1)
    with pytest.raises(MeshError, match="'all'"):
        sb.attach(client, microphone=()).add(body, link="all", material=STEEL)


def test_progress_names_each_link_and_how_many_there_are(
    client: Any, tmp_path: Path, solver: Callable[..., Solver]
) -> None:
    body = boxes(client, tmp_path)
    solver()
    seen: list[str] = []
    listener = sb.attach(client)
    listener.add(body, link="all", material=STEEL, progress=seen.append)
    assert not seen
    listener.solve_all()
    for number, name in enumerate(("crane", "crane/arm", "crane/tip"), start=1):
        assert f"modes of {name} (body {body}), {number} of 3" in seen
    assert sum(line.endswith(": filling") for line in seen) == 2  # arm and tip are equal: one of them is solved
    assert seen[-1] == f"how 4 modes of crane/tip (body {body}) radiate"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("stream", "shown"), [(Terminal, True), (io.StringIO, False)])
def test_a_terminal_shows_which_link_is_computed(
    client: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    solver: Callable[..., Solver],
    stream: type[io.StringIO],
    shown: bool,
) -> None:
    """Without `progress`: one rewritten line on a terminal's stderr, in a pipe nothing of what is quick."""
    monkeypatch.delenv("SONIC_BULLET_PROGRESS", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    body = boxes(client, tmp_path)
    solver(pause_s=0.3)
    err = stream()
    monkeypatch.setattr("sys.stderr", err)
    listener = sb.attach(client, microphone=())
    listener.add(body, link="all", material=STEEL)
    listener.solve_all()
    said = err.getvalue()
    assert bool(said) is shown
    if shown:
        assert f"modes of crane/arm (body {body}), 2 of 3: filling" in said  # the tip equals it
        assert "\x1b[2K" in said  # rewritten in place


def test_a_status_within_a_status_writes_into_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A script that `sonic-bullet render` runs adds bodies of its own: one line, not two that fight for it."""
    from sonic_bullet.machine.progress import shown_by, status

    monkeypatch.setattr("sys.stderr", Terminal())
    seen: list[str] = []
    with shown_by(seen.append), status("inner"):
        report_progress("something")
    assert seen == ["something"]
