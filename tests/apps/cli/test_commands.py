"""The command line around the run time: what it passes on, writes, says, and how it ends.

The run time itself is replaced by a stub.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

import sonic_bullet.engine.runtime.replay
import sonic_bullet.scene
from sonic_bullet.apps.cli import main
from sonic_bullet.files import read_audio, read_log, write_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records import Body, Microphone, ModalModel
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.scene import RenderResult
from tests.few_cases import parametrize_few

SR = 8000


def model() -> ModalModel:
    return ModalModel(
        [100.0, 200.0],
        [1.0, np.nan],
        np.zeros((3, 3, 2)),
        np.eye(3),
        [[0, 1, 2]],
        [0.0],
        1e-3,
        0.5,
        dropped=4,
        note="stub",
    )


def log(steps: int = 10) -> ContactLog:
    bodies = (Body(3, 1, 0, "cup", 0.1, np.eye(3), model=model()), Body(0, -1, 0, "floor", 0.0, np.zeros((3, 3))))
    one = Contacts(
        [0],
        [1],
        point_a_m=np.zeros((1, 3)),
        point_b_m=np.zeros((1, 3)),
        normal=[[0, 0, 1]],
        impulse_n_s=[[0, 0, 0.1]],
        slip_m_s=np.zeros((1, 3)),
        sweep_m_s=np.zeros((1, 2)),
        approach_m_s=[1.0],
        gap_m=[0.0],
    )
    still = (np.zeros((2, 3)), np.tile([0, 0, 0, 1.0], (2, 1)), np.zeros(2, bool))
    return ContactLog(
        bodies,
        tuple(Step(0.1, *still, one if i == 2 else Contacts.none()) for i in range(steps)),
        (Microphone([0, 0, 1]),),
        SR,
        5,
    )


def sound(seconds: float = 1.0, sr: int = SR) -> np.ndarray:
    return 0.1 * np.sin(np.arange(round(seconds * sr)) * [[0.3]])


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.py").write_text("")
    return tmp_path / "scene.py"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the stubs of the run time were asked for."""
    kept: dict[str, Any] = {}

    def render_scene(path: object, **options: Any) -> RenderResult:
        kept.update(options, path=str(path))
        print("the scene prints")
        os.write(1, b"a C library prints\n")
        return RenderResult(KeptSound.of(sound(sr=options["sr"])), log(), options["sr"], ("a note",))

    def render_kept(given: ContactLog, *, sr: int | None = None, **_: Any) -> KeptSound:
        kept.update(log=given, sr=sr)
        return KeptSound.of(sound(given.duration_s, sr or given.sr))

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    monkeypatch.setattr(sonic_bullet.engine.runtime.replay, "render_kept", render_kept)
    monkeypatch.setattr("sonic_bullet.engine.runtime.sound_events.find_sound_events", lambda *_, **__: ())
    return kept


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    before = signal.getsignal(signal.SIGTERM)
    with warnings.catch_warnings():
        yield
    signal.signal(signal.SIGTERM, before)


def run(*words: object) -> int:
    """The exit code of the command line, run in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["sonic-bullet", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0)


def error_of(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """The one line that a failing command says, beside notes on its scene."""
    assert run(*words) == 2
    said = capfd.readouterr()
    assert "Traceback" not in said.err
    lines = [line for line in said.err.splitlines() if not line.startswith("sonic-bullet: note: ")]
    assert len(lines) == 1, lines
    assert lines[0].startswith("sonic-bullet: ")
    assert said.out in ("", "the scene prints\na C library prints\n")
    return lines[0]


# ---- render


def test_render_writes_all_it_was_asked_for(
    scene: Path, asked: dict[str, Any], capfd: pytest.CaptureFixture[str]
) -> None:
    code = run(
        "render",
        "scene.py",
        "-o",
        "a.wav",
        "--contacts",
        "a.npz",
        "--picture",
        "a.png",
        "--json",
        "a.json",
        "--seconds",
        2,
        "--sr",
        16000,
        "--seed",
        7,
    )
    said = capfd.readouterr()
    assert code == 0
    assert sorted(p.name for p in scene.parent.iterdir()) == ["a.json", "a.npz", "a.png", "a.wav", "scene.py"]
    assert (asked["seconds"], asked["sr"], asked["seed"], asked["microphones"], asked["material"]) == (
        2.0,
        16000,
        7,
        None,
        None,
    )
    assert "a.wav: 1.000 s, 1 channel, 16000 Hz" in said.out
    assert (
        said.err == "sonic-bullet: 0 dBFS = 0.112 Pa (peak 74 dB SPL)\nsonic-bullet: note: a note\n"
    )  # no progress in a pipe
    described = json.loads((scene.parent / "a.json").read_text())
    assert (
        described["output"],
        described["sr"],
        described["channels"],
        described["frames"],
        described["contacts"],
    ) == ("a.wav", 16000, 1, 16000, 1)
    first = {"body": 3, "link": 1, "name": "cup", "material": None, "modes": 2, "dropped": 4}
    assert described["bodies"][0] == first | {
        **{"since_step": 0, "until_step": -1, "mounting": "free"},
        **{"options": None, "dynamics": {}},
    }
    assert (described["engine"], described["versions"], described["events"], described["changes"]) == ({}, {}, [], [])
    assert described["notes"] == ["a note"]
    assert described["peak_pa"] == pytest.approx(0.1, rel=1e-3)
    assert len(read_log("a.npz")) == 1


def test_a_replay_is_with_or_without_residual_as_the_log_says_unless_asked(
    scene: Path, asked: dict[str, Any], capfd: pytest.CaptureFixture[str]
) -> None:
    write_log("with.npz", log())
    write_log("without.npz", replace(log(), residual=False))
    heard = {}
    for name in ("with", "without"):
        for words in ((), ("--residual",), ("--no-residual",)):
            assert run("render", f"{name}.npz", "-o", "a.wav", "--contacts", "b.npz", *words) == 0
            assert read_log("b.npz").residual == asked["log"].residual
            heard[name, *words] = asked["log"].residual
    assert heard == {
        ("with",): True,
        ("with", "--residual"): True,
        ("with", "--no-residual"): False,
        ("without",): False,
        ("without", "--residual"): True,
        ("without", "--no-residual"): False,
    }


def test_json_alone_on_stdout_whatever_the_scene_prints(
    scene: Path, asked: dict[str, Any], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run("render", "scene.py", "-o", "a.wav", "--json") == 0
    said = capfd.readouterr()
    assert json.loads(said.out)["output"] == "a.wav"
    assert "the scene prints" in said.err
    assert "a C library prints" in said.err


@pytest.mark.parametrize(
    "words",
    [
        ["--json", "scene.py", "-o", "a.wav"],
        ["scene.py", "--json", "-o", "a.wav"],
        ["scene.py", "-o", "a.wav", "--json=-"],
    ],
)
def test_json_takes_a_path_only_where_one_stands(
    scene: Path, asked: dict[str, Any], capfd: pytest.CaptureFixture[str], words: list[str]
) -> None:
    assert run("render", *words) == 0
    assert json.loads(capfd.readouterr().out)["output"] == "a.wav"
    assert scene.read_text() == ""


def test_defaults_and_microphones(scene: Path, asked: dict[str, Any]) -> None:
    assert (
        run(
            "render",
            "scene.py",
            "-o",
            "a.wav",
            "--microphone",
            "0,-1,0.5",
            "--microphone",
            "1e-1,2,-3",
            "--material",
            "wood",
        )
        == 0
    )
    assert (asked["sr"], asked["seed"], asked["seconds"]) == (48_000, 0, None)
    assert asked["microphones"] == ((0, -1, 0.5), (0.1, 2, -3))
    assert asked["material"] == "wood"


@pytest.mark.parametrize(("options", "level"), [(["--peak-dbfs", "-6"], -6.0), (["--peak-dbfs", "-0.5"], -0.5)])
def test_peak_is_scaled(scene: Path, asked: dict[str, Any], options: list[str], level: float) -> None:
    assert run("render", "scene.py", "-o", "a.wav", *options) == 0
    assert 20 * np.log10(np.abs(soundfile.read("a.wav")[0]).max()) == pytest.approx(level, abs=0.01)


def test_clipping_is_reported(scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(
        sonic_bullet.scene, "render_scene", lambda path, **options: RenderResult(KeptSound.of(sound() * 30), log(), SR)
    )
    assert run("render", "scene.py", "-o", "a.flac", "--pascals", "--json", "a.json") == 0
    clipped = json.loads(Path("a.json").read_text())["clipped"]
    assert clipped > 1000
    out, err = capfd.readouterr()
    assert ", clipped" in out and "which the file does not hold" in err
    assert f"{clipped} samples were clipped" in err and "FLAC PCM_24 holds nothing above 1.0" in err and ".wav" in err
    assert run("render", "scene.py", "-o", "a.wav", "--pascals", "--json", "a.json") == 0
    assert json.loads(Path("a.json").read_text())["clipped"] == 0
    out, err = capfd.readouterr()
    assert "the file is exact" in err and "clipped" not in out and "does not hold" not in err


def test_a_log_renders_again_with_its_own_rate_and_seed(scene: Path, asked: dict[str, Any]) -> None:
    write_log("a.npz", log())
    assert run("render", "a.npz", "-o", "a.wav", "--contacts", "b.npz") == 0
    assert asked["sr"] is None
    assert soundfile.info("a.wav").samplerate == SR
    assert Path("a.npz").read_bytes() == Path("b.npz").read_bytes()


def test_a_log_may_leave_its_models_to_the_cache(
    scene: Path, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SONIC_BULLET_CACHE", str(scene.parent / "kept"))
    write_log("a.npz", log())
    assert run("render", "a.npz", "-o", "a.wav", "--contacts", "b.npz", "--models", "reference") == 0
    assert len(list((scene.parent / "kept").glob("model-*.npz"))) == 1
    assert run("render", "b.npz", "-o", "b.wav", "--contacts", "c.npz") == 0
    assert Path("a.npz").read_bytes() == Path("c.npz").read_bytes()


def test_a_log_with_wishes(scene: Path, asked: dict[str, Any]) -> None:
    write_log("a.npz", log())
    assert (
        run("render", "a.npz", "-o", "a.wav", "--sr", 16000, "--seed", 9, "--seconds", 0.5, "--microphone", "1,2,3")
        == 0
    )
    assert (asked["sr"], asked["log"].seed, len(asked["log"].steps), len(asked["log"].sensors)) == (16000, 9, 5, 1)
    np.testing.assert_array_equal(asked["log"].sensors[0].position_m, [1, 2, 3])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.py", "-o", "a.wav"], "no such file"),
        (["scene.txt", "-o", "a.wav"], "no such file"),
        (["folder", "-o", "a.wav"], "it is a folder"),
        (["scene.py", "-o", "a.xyz"], "no audio format"),
        (["scene.py", "-o", "folder"], "audio format"),
        (["scene.py", "-o", "none/a.wav"], "mkdir -p"),
        (["scene.py", "-o", "folder.wav"], "folder"),
        (["scene.py", "-o", "a.wav", "--sr", "0"], "sample rate 0 Hz"),
        (["scene.py", "-o", "a.wav", "--sr", "1e9"], "sample rate 1e+09 Hz"),
        (["scene.py", "-o", "a.wav", "--sr", "nan"], "sample rate nan"),
        (["scene.py", "-o", "a.wav", "--sr", "many"], "--sr"),
        (["scene.py", "-o", "a.wav", "--seconds", "0"], "seconds"),
        (["scene.py", "-o", "a.wav", "--seconds", "nan"], "seconds"),
        (["scene.py", "-o", "a.wav", "--material", "woood"], "did you mean wood"),
        (["scene.py", "-o", "a.wav", "--peak-dbfs", "1", "--lufs", "-23"], "is not in the range"),
        (["scene.py", "-o", "a.wav", "--fade", "-1"], "--fade"),
        (["scene.py", "-o", "a.wav", "--lufs", "nan"], "is no number"),
        (["scene.py", "-o", "a.wav", "--microphone", "1,2"], "X,Y,Z"),
        (["scene.py", "-o", "a.wav", "--microphone", "1,2,nan"], "X,Y,Z"),
        (["scene.py", "-o", "a.wav", "--seed", "-1"], "--seed"),
        (["scene.py", "-o", "a.wav", "--contacts", "a.txt"], ".npz"),
        (["scene.py", "-o", "a.wav", "--models", "reference"], "give --contacts too"),
        (["scene.py", "-o", "a.wav", "--contacts", "a.npz", "--models", "away"], "'included', 'reference'"),
        (["scene.py", "-o", "a.wav", "--picture", "a.wav"], "picture format"),
        (["scene.py", "-o", "a.wav", "--json=./a.wav"], "one name"),
        (["scene.py", "-o", "a.wav", "--colour"], "--colour"),
        (["scene.py"], "--output"),
        ([], "Missing argument"),
        (["cut.npz", "-o", "a.wav"], "cut.npz is cut"),
        (["good.npz", "-o", "a.wav", "--material", "nobody=wood"], "called 'nobody'"),
        (["good.npz", "-o", "a.wav", "--seconds", "5"], "lasts 1.000 s"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(
    scene: Path, asked: dict[str, Any], capfd: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    (scene.parent / "folder").mkdir()
    (scene.parent / "folder.wav").mkdir()
    write_log("good.npz", log())
    Path("cut.npz").write_bytes(Path("good.npz").read_bytes()[:500])
    before = sorted(scene.parent.iterdir())
    assert said in error_of(capfd, "render", *words)
    assert sorted(scene.parent.iterdir()) == before


@pytest.mark.parametrize(
    "words",
    [
        "fit x",
        "film x.py",
        "score x.glb",
        "bake x.obj",
        "residual x",
        "dataset x.py",
        "dataset household",
    ],
)
def test_an_option_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "--output" in error_of(capfd, *words.split())


@pytest.mark.parametrize("error", [SceneError("body 3 has mass nan", "mend it"), KeyboardInterrupt()])
@pytest.mark.parametrize("level", [[], ["--peak-dbfs", "-1"], ["--lufs", "-20"]])
def test_what_was_rendered_before_an_error_is_a_valid_named_file(
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    error: BaseException,
    level: list[str],
) -> None:
    def render_scene(path: object, **options: Any) -> RenderResult:
        error.partial = RenderResult(KeptSound.of(sound(0.25)), log(), SR)  # type: ignore[attr-defined]
        raise error

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    Path("a.wav").write_bytes(b"old")
    assert run("render", "scene.py", "-o", "a.wav", "--contacts", "a.npz", *level) == (
        130 if isinstance(error, KeyboardInterrupt) else 2
    )
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "the first 0.250 s are in a.partial.wav" in lines[0]
    assert "mend it" in lines[0] or isinstance(error, KeyboardInterrupt)
    assert soundfile.info("a.partial.wav").frames == SR // 4
    assert Path("a.wav").read_bytes() == b"old"
    assert not Path("a.npz").exists()


def test_what_a_replay_rendered_before_an_interrupt_is_a_valid_named_file(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def render_blocks(*_: Any, **options: Any) -> Iterator[np.ndarray]:
        yield sound(0.25)
        raise KeyboardInterrupt

    monkeypatch.setattr(sonic_bullet.engine.runtime.replay, "_blocks", render_blocks)
    write_log("a.npz", log())
    assert run("render", "a.npz", "-o", "a.wav") == 130
    assert "the first 0.250 s are in a.partial.wav" in capfd.readouterr().err
    np.testing.assert_allclose(read_audio("a.partial.wav")[0], sound(0.25), atol=2**-24)
    assert not Path("a.wav").exists()


def test_an_error_is_said_where_what_was_rendered_before_it_cannot_be_kept_either(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def render_scene(path: object, **options: Any) -> RenderResult:
        error = SceneError("body 3 has mass nan", "mend it")
        error.partial = RenderResult(KeptSound.of(sound(0.25)), log(), SR)  # type: ignore[attr-defined]
        raise error

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    Path("a.partial.wav").mkdir()
    assert error_of(capfd, "render", "scene.py", "-o", "a.wav").startswith(
        "sonic-bullet: body 3 has mass nan; mend it; cannot write"
    )


@pytest.mark.parametrize("partial", [None, RenderResult(KeptSound.of(np.zeros((1, 0))), log(), SR)])
def test_an_error_before_any_sound_leaves_nothing(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], partial: RenderResult | None
) -> None:
    def render_scene(path: object, **options: Any) -> RenderResult:
        error = SceneError("what", "remedy")
        error.partial = partial  # type: ignore[attr-defined]
        raise error

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    assert error_of(capfd, "render", "scene.py", "-o", "a.wav") == "sonic-bullet: what; remedy"
    assert list(scene.parent.iterdir()) == [scene]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), MemoryError(), ZeroDivisionError("x\ny")])
def test_the_unexpected_is_one_line_too(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], error: Exception
) -> None:
    def render_scene(path: object, **options: Any) -> RenderResult:
        raise error

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    assert type(error).__name__ in error_of(capfd, "render", "scene.py", "-o", "a.wav")


# ---- doctor


def test_doctor_prints_findings_with_remedies(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    finding = sonic_bullet.scene.Finding("sub-steps", "error", "numSubSteps is 4", "set it to 1")
    monkeypatch.setattr(sonic_bullet.scene, "examine_scene", lambda path, seconds, client: (finding,))
    assert run("doctor", "scene.py") == 0
    said = capfd.readouterr().out
    assert "error: sub-steps: numSubSteps is 4" in said
    assert "set it to 1" in said
    assert run("doctor", "scene.py", "--json") == 0
    assert json.loads(capfd.readouterr().out)["findings"] == [
        {"id": "sub-steps", "severity": "error", "what": "numSubSteps is 4", "remedy": "set it to 1"}
    ]
    assert "contact log" in error_of(capfd, "doctor", "a.npz")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("stream", [Terminal, io.StringIO])
def test_a_terminal_is_told_which_body_is_analysed_and_a_pipe_nothing(
    scene: Path, monkeypatch: pytest.MonkeyPatch, stream: type[io.StringIO]
) -> None:
    told = stream()
    monkeypatch.delenv("SONIC_BULLET_PROGRESS", raising=False)

    def render_scene(path: object, **options: Any) -> RenderResult:
        report_progress("modes of cup (body 3): assembling")
        return RenderResult(KeptSound.of(sound()), log(), SR)

    monkeypatch.setattr(sonic_bullet.scene, "render_scene", render_scene)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "stderr", told)
    assert run("render", "scene.py", "-o", "a.wav") == 0
    assert ("scene.py: modes of cup (body 3): assembling" in told.getvalue()) == (stream is Terminal)
    assert told.getvalue().startswith("sonic-bullet: 0 dBFS = ") or stream is Terminal


# ---- the process itself


def sonic_bullet_process(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from sonic_bullet.apps.cli import main; main()", *words],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
        **options,
    )


@parametrize_few(
    "words",
    [
        ["--help"],
        ["render", "--help"],
        ["modes", "-h"],
        ["doctor", "--help"],
        ["materials", "--help"],
        ["cache", "--help"],
    ],
    (0, 1),
)
def test_help_teaches_by_example(words: list[str]) -> None:
    done = sonic_bullet_process(*words)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Usage: sonic-bullet" in done.stdout
    assert "sonic-bullet " + words[0] in done.stdout if len(words) > 1 else "Examples" in done.stdout


def test_version() -> None:
    assert sonic_bullet_process("--version").stdout == "sonic-bullet, version 0.1.0\n"


@pytest.mark.slow
def test_a_terminal_without_greek_and_a_reader_that_leaves() -> None:
    plain = sonic_bullet_process("materials", env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (plain.returncode, plain.stderr) == (0, "")
    piped = subprocess.run(
        f"{sys.executable} -c 'from sonic_bullet.apps.cli import main; main()' materials --json | head -c 1",
        shell=True,
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (piped.stdout, piped.stderr) == ("{", "")


def test_debug_shows_where(tmp_path: Path) -> None:
    done = sonic_bullet_process(
        "render", "none.py", "-o", "a.wav", cwd=tmp_path, env={**os.environ, "SONIC_BULLET_DEBUG": "1"}
    )
    assert "Traceback" in done.stderr
