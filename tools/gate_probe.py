"""Run probes in one tree of the project and keep their values: the same text runs on both sides of `gate.py`.

    python gate_probe.py JOB.json   with PYTHONPATH = the tree
    JOB.json -> {"tree", "job", "probes": {name: file}, "data"} -> one npz a probe -> one JSON line a probe on stdout

Only public doors are used, since modules may move: `sonic_bullet`'s own names and the command line. One probe needs
more, blocks of steps: its class is looked for by name, wherever it lies.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

Values = dict[str, Any]
LONGEST_S = 2.0  # of a scene: the ball of rolling.py meets the rough board at 1.4 s, the arm its dominoes before 1 s
LONGEST_COMMAND_S = 1.0  # of a scene rendered by the command line, which is followed by its ringing
RESIDUAL = "ceramic-mug"  # the preset whose residual every body gets
PATHS: list[tuple[str, str]] = []
"""What differs between two sides by their place alone, and what stands for it."""


def flatten(value: object, name: str = "") -> Iterator[tuple[str, object]]:
    """Give the leaves of nested mappings, sequences and records, each with its path."""
    if isinstance(value, Mapping):
        for key in sorted(value, key=str):
            yield from flatten(value[key], f"{name}/{key}")
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from flatten(getattr(value, field.name, None), f"{name}/{field.name}")
    elif isinstance(value, (list, tuple)):
        yield f"{name}/length", len(value)
        for number, one in enumerate(value):
            yield from flatten(one, f"{name}/{number}")
    else:
        yield name, value


def collect(value: object, name: str) -> Values:
    """Make arrays of any value: its own arrays, one of all numbers with their paths, one of all other leaves."""
    numbers: list[tuple[str, float]] = []
    texts: list[str] = []
    found: Values = {}
    for path, leaf in flatten(value, name):
        if isinstance(leaf, np.ndarray) and leaf.dtype != object:
            found[path] = leaf
        elif isinstance(leaf, (int, float, np.integer, np.floating)) and not isinstance(leaf, bool):
            numbers.append((path, float(leaf)))
        else:
            text = sorted(map(str, leaf)) if isinstance(leaf, (set, frozenset)) else leaf
            said = f"{path}={text}"
            for place, sign in PATHS:
                said = said.replace(place, sign)
            texts.append(said)
    found[f"{name}: numbers"] = np.array([x for _, x in numbers], float)
    found[f"{name}: paths of numbers"] = np.array([path for path, _ in numbers], str)
    found[f"{name}: texts"] = np.array(texts, str)
    return found


def read_npz(path: Path, name: str) -> Values:
    """Read all arrays of an npz file; its JSON header as numbers and texts."""
    found: Values = {}
    with np.load(path, allow_pickle=False) as arrays:
        for key in sorted(arrays.files):
            array = arrays[key]
            if key == "header":
                text = array.tobytes() if array.dtype == np.uint8 else str(array.item())
                found |= collect(json.loads(text), f"{name}/header")
            else:
                found[f"{name}/{key}"] = array
    return found


def read_sound(path: Path, name: str) -> Values:
    """Read the samples of a sound file as they lie in it, and its rate."""
    import soundfile

    samples, sr = soundfile.read(path, dtype="float64", always_2d=True)
    return {f"{name}/samples": samples, f"{name}/sr": np.array([float(sr)])}


def run_command(*words: str, folder: Path, codes: tuple[int, ...] = (0,)) -> None:
    """Run the tree's command line in a folder; what it says of a failure is the error."""
    command = [sys.executable, "-m", "sonic_bullet", *words]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode not in codes:
        said = (done.stderr.strip() or done.stdout.strip() or "no word").splitlines()[-1]
        raise RuntimeError(f"{words[0]} ended with {done.returncode}: {said}")


class SceneJob:
    """A scene of the tree, its listeners and its log, each made when a probe first asks for it."""

    def __init__(self, name: str, tree: Path, work: Path) -> None:
        self.path, self.work = tree / "scenes" / f"{name}.py", work
        names: dict[str, Any] = {"__file__": str(self.path), "__name__": "scene"}
        exec(compile(self.path.read_text(encoding="utf-8"), str(self.path), "exec"), names)
        self.names = names
        self.seconds = min(float(names.get("SECONDS", 4.0)), LONGEST_S)

    def listen(
        self, *, sensors: Callable[[Any], Any] | None = None, material: Callable[[Any], Any] | None = None, **how: Any
    ) -> tuple[Any, list[Any]]:
        """Run the scene with a listener.

        Parameters
        ----------
        sensors
            Makes sensors of the cast; None: the scene's own microphones.
        material
            Makes another material of each one's.
        how
            Further arguments of `attach`.

        Returns
        -------
        The listener and the frame of every step.
        """
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        import sonic_bullet as sb

        client = BulletClient(pybullet.DIRECT)
        cast = self.names["build"](client)
        places = sensors(cast) if sensors else self.names.get("MICROPHONE", (0.0, -1.0, 0.5))
        listener = sb.attach(client, microphone=places, seed=0, **how)
        if material:
            plain = {who: one if isinstance(one, dict) else {"material": one} for who, one in cast.items()}
            cast = {who: {**one, "material": material(one["material"])} for who, one in plain.items()}
        listener.add_all(cast)
        act, frames = self.names.get("act"), []
        while listener.time_s < self.seconds - 1e-9:
            if act is not None:
                act(client, listener.time_s)
            client.stepSimulation()
            frames.append(listener.frame.copy())
        listener.detach()
        return listener, frames

    @cached_property
    def live(self) -> tuple[Any, list[Any]]:
        return self.listen(sr=48_000)

    @cached_property
    def log(self) -> Any:
        """The log of the live run, as it is read again from its file."""
        import sonic_bullet as sb

        self.live[0].contacts.save(self.work / "live.npz")
        return sb.read_log(self.work / "live.npz")

    def probe_live_48000(self) -> Values:
        return played(*self.live)

    def probe_live_44100(self) -> Values:
        return played(*self.listen(sr=44_100))

    def probe_no_supports(self) -> Values:
        return played(*self.listen(sr=48_000, supports=False))

    def probe_residual(self) -> Values:
        import sonic_bullet as sb

        def with_residual(material: Any) -> Any:
            own = material if isinstance(material, sb.Material) else sb.load_material(material)
            return replace(own, residual=sb.load_material(RESIDUAL).residual)

        return played(*self.listen(sr=48_000, material=with_residual))

    def probe_vibrometer(self) -> Values:
        """A vibrometer on every body of the cast, beside a microphone and the plain sum of modes."""
        import sonic_bullet as sb

        def sensors(cast: Any) -> tuple[Any, ...]:
            links = [who if isinstance(who, tuple) else (who, -1) for who in cast]
            middle, up = np.zeros(3), np.array([0.0, 0.0, 1.0])
            looks = [sb.Vibrometer(body, middle, up, link if isinstance(link, int) else -1) for body, link in links]
            return (sb.Microphone(np.array([0.0, -0.5, 0.4])), sb.ModalSum(0.5), *looks)

        return played(*self.listen(sr=48_000, sensors=sensors))

    def probe_replay(self) -> Values:
        import sonic_bullet as sb

        return {"sound": sb.render_log(self.log)}

    def probe_replay_44100(self) -> Values:
        import sonic_bullet as sb

        return {"sound": sb.render_log(self.log, sr=44_100)}

    def probe_blocks_1(self) -> Values:
        return {"sound": play_blocks(self.log, 1)}

    def probe_blocks_7(self) -> Values:
        return {"sound": play_blocks(self.log, 7)}

    def probe_blocks_64(self) -> Values:
        return {"sound": play_blocks(self.log, 64)}

    def probe_models(self) -> Values:
        """The modal models of all bodies, with what the log says of each body."""
        return collect(self.live[0].contacts.bodies, "bodies")

    @cached_property
    def rendered(self) -> Path:
        """The folder with what the command line renders of the scene."""
        seconds = min(float(self.names.get("SECONDS", 4.0)), LONGEST_COMMAND_S)
        folder = self.work / "rendered"
        folder.mkdir()
        run_command(
            "render", str(self.path), "-o", "a.wav", "--contacts", "a.npz", "--events", "a.json",
            "--json", "report.json", "--seconds", f"{seconds:g}", folder=folder,
        )  # fmt: skip
        return folder

    def probe_wav(self) -> Values:
        return read_sound(self.rendered / "a.wav", "a.wav")

    def probe_contact_log(self) -> Values:
        return read_npz(self.rendered / "a.npz", "a.npz")

    def probe_events(self) -> Values:
        return read_json(self.rendered / "a.json", "events") | read_json(self.rendered / "report.json", "report")

    def probe_stems(self) -> Values:
        """The stems of the log, and the mix that they add up to."""
        words = ("--pascals", "--tail", "0", "--stems", "stems", "--json", "mix.json")
        run_command("render", "a.npz", "-o", "mix.wav", *words, folder=self.rendered)
        found = read_sound(self.rendered / "mix.wav", "mix") | read_json(self.rendered / "mix.json", "report")
        for path in sorted((self.rendered / "stems").iterdir()):
            found |= (read_json if path.suffix == ".json" else read_sound)(path, path.name)
        return found


def played(listener: Any, frames: list[Any]) -> Values:
    """Keep the frames of a live run and its whole sound."""
    lengths = np.array([frame.shape[1] for frame in frames])
    return {"frames": np.concatenate(frames, axis=1), "lengths": lengths, "sound": listener.sound()}


def play_blocks(log: Any, count: int) -> Any:
    """Play a log by so many steps at once, fewer before a quench and where bodies come or go: (channels, n) in Pa."""
    import sonic_bullet as sb

    sb.render_log(log.first(1))  # now the class is among the modules
    modules = [module for name, module in sorted(sys.modules.items()) if name.startswith("sonic_bullet.")]
    classes = [vars(module)["Synthesizer"] for module in modules if "Synthesizer" in vars(module)]
    if not classes:
        raise LookupError("no class Synthesizer in any module of the package")
    how = {name: getattr(log, name) for name in ("sr", "sensors", "seed", "air", "residual", "supports")}
    synth = classes[0](**how)
    group: list[Any] = []
    quenches = {event.step for event in log.events if event.kind == "quench"}
    for number, step in enumerate(log.steps):
        if group and (len(group) == count or number in quenches or not np.array_equal(step.body, group[0].body)):
            synth.play(group, log.bodies)
            group = []
        if number in quenches:
            synth.quench()
        group.append(step)
    synth.play(group, log.bodies)
    return synth.sound()


def read_json(path: Path, name: str) -> Values:
    """Read a JSON file as numbers and texts."""
    return collect(json.loads(path.read_text(encoding="utf-8")), name)


def probe_modes(mesh: Path, work: Path) -> Values:
    """Solve the modes of a mesh, in steel, up to 20 kHz."""
    run_command("modes", str(mesh), "--material", "steel", "--json", "m.json", "-o", "m.npz", folder=work)
    return read_json(work / "m.json", "report") | read_npz(work / "m.npz", "model")


def probe_case(command: str, case: Path, work: Path) -> Values:
    """Run `fit` or `diagnose` on a case: its JSON and its preset. A diagnosis may end with 1."""
    run_command(command, str(case), "-o", "preset.json", "--json", "j.json", folder=work, codes=(0, 1))
    return read_json(work / "j.json", "report") | read_json(work / "preset.json", "preset")


def probes_of(job: str, tree: Path, data: Path, work: Path) -> Callable[[str], Values]:
    """Give what makes the values of a job's probe, by its name."""
    kind, _, name = job.partition("/")
    if kind == "scene":
        scene = SceneJob(name, tree, work)

        def values(probe: str) -> Values:
            made: Values = getattr(scene, "probe_" + probe.removeprefix(job + "/").replace("-", "_"))()
            return made

        return values
    if kind == "modes":
        return lambda _: probe_modes(tree / name, work)
    return lambda _: probe_case(kind, data / "practice" / name, work)


def keep(values: Values, path: Path) -> None:
    """Write values as npz, whole or not at all."""
    part = path.with_suffix(".partial")
    with part.open("wb") as file:
        np.savez(file, **values)
    os.replace(part, path)


def used_s() -> float:
    """Give the processor time of this process and of those that it has started and that have ended."""
    return sum(os.times()[:4])


def main() -> int:
    """Run the probes of a job, one after another; one that fails says so and the others go on."""
    asked = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    tree, work = Path(asked["tree"]), Path(sys.argv[1]).parent
    import sonic_bullet as sb

    if not Path(str(sb.__file__)).resolve().is_relative_to(tree.resolve()):
        raise SystemExit(f"the package comes from {sb.__file__}, not from the tree")
    PATHS.extend([(str(tree), "TREE"), (str(work), "WORK")])
    make: Callable[[str], Values] | None = None
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")  # PyBullet prints on the other one
    os.dup2(2, 1)
    for name, place in asked["probes"].items():
        start, error = used_s(), ""
        try:
            make = make or probes_of(asked["job"], tree, Path(asked["data"]), work)
            keep(make(name), Path(place))
        except Exception as problem:
            error = f"{type(problem).__name__}: {problem}".splitlines()[0][:300]
        print(json.dumps({"probe": name, "used_s": used_s() - start, "error": error}), file=out, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
