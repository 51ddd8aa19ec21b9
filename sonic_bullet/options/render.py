"""Options of `render`, and what `play`, `film` and `score` share with it.

SceneOptions, RenderSceneOptions are also keywords of `sonic_bullet.scene.run_scene` and `render_scene`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from sonic_bullet.options.audio import FileLevelOptions
from sonic_bullet.options.option import Options, group, option
from sonic_bullet.records.errors import FileError, MaterialError, SceneError, SonicBulletError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

if TYPE_CHECKING:
    from sonic_bullet.records import Material, Sensor
    from sonic_bullet.records.sensors import MicrophoneLike

Point = tuple[float, float, float]
DEFAULT_SR, SAMPLE_RATES_HZ = 48_000, (8000, 384_000)
DEFAULT_MICROPHONE = (0.0, -1.0, 0.5)
DEFAULT_ABSORPTION = 0.2


def client_option() -> int | None:
    """Make the field of --client, alike in all commands that run a script."""
    return option(
        None,
        "Of a script with several physics clients, listen to the one with this id.",
        metavar="N",
        least=0,
        unset="the first that steps",
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneOptions(Options):
    """Scene or log.

    materials: of bodies and links by name, which take precedence over ``material``.
    """

    error: ClassVar[type[SonicBulletError]] = SceneError
    seconds: float | None = option(
        None,
        "How long to simulate; of a log, how much of it.",
        metavar="S",
        above=0,
        most=1_000_000,
        unset="the scene's own, else 4; all of a log",
    )
    sr: int | None = option(
        None,
        "Sample rate in Hz, {} … {}.".format(*SAMPLE_RATES_HZ),
        metavar="HZ",
        words=float,
        unset=f"{DEFAULT_SR}; a log's own",
    )
    microphones: MicrophoneLike | None = option(
        None,
        "A microphone in the world, in m, a channel each.",
        "--microphone",
        metavar="X,Y,Z",
        words=tuple[Point, ...],
        unset="the scene's own, or {:g},{:g},{:g}".format(*DEFAULT_MICROPHONE),
    )
    seed: int | None = option(None, "Seed of the surfaces' roughness.", least=0, unset="0; a log's own")
    material: str | Path | Material | None = option(
        None,
        "Material (a name or a preset file) of the body NAME, or of all that sounds, whatever the scene or log says. "
        "Motion and mass stay.",
        metavar="[NAME=]M",
        words=tuple[str, ...],
        unset="as the scene or log has it",
    )
    materials: Mapping[str, str | Path | Material] | None = None
    silent: Iterable[str] = option(
        (), "No microphone hears the body NAME; others touch it as before.", metavar="NAME", words=tuple[str, ...]
    )
    fill_modes: bool = option(
        False, "Of a scene: plates and shells go on above their last mode, as dense as bending waves are."
    )
    draft: bool = option(False, "Of a scene: a first sound within seconds, of few modes of coarse elements.")
    client: int | None = client_option()

    @classmethod
    def from_words(cls, *, material: tuple[str, ...] = (), **others: Any) -> SceneOptions:
        """Read M or NAME=M of a command line; a file whose name holds an "=" is not split.

        Raises MaterialError, FileError where something is said twice.
        """
        everyone, named = None, dict[str, str]()
        for given in material:
            name, equals, of = ("", "", given) if "=" not in given or Path(given).is_file() else given.partition("=")
            if equals and not (name.strip() and of.strip()):
                raise MaterialError(f"--material {given} is neither M nor NAME=M", "give --material bowl=steel")
            if name in named or (not equals and everyone is not None):
                whom = name if equals else "all bodies"
                raise MaterialError(f"--material says twice what {whom} is made of", "give it once")
            if equals:
                named[name] = of
            else:
                everyone = of
        silent = others.get("silent", ())
        for name in silent:
            if silent.count(name) > 1:
                raise FileError(f"--silent names {name} twice", "give it once")
        return cls(material=everyone, materials=named, **others)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderSceneOptions(SceneOptions):
    """Scene or log."""

    residual: bool | None = option(
        None, "What presets sound beside their modes.", unset="it sounds; of a log, as it was rendered"
    )
    supports: bool | None = option(
        None, "Bodies that stand on others ring less.", unset="they do; of a log, as it was rendered"
    )
    image: bool | None = option(
        None,
        "Planes, and flat faces from 0.25 m on of bodies that do not move, mirror what sounds before them: up to 6 dB "
        "of what sounds alike all round, 9.5 with two faces, 12 with three. "
        "Walls of a --room or --response count once.",
        unset="as the script's own listener has it, or the log",
    )
    at_start: Callable[[Any], object] | None = None  # with the Listener
    at_end: Callable[[Any], object] | None = None  # with the Listener
    tail_db: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaySceneOptions(SceneOptions):
    """Scene or log."""

    receive: Callable[[tuple[Sensor, ...]], tuple[Sensor, ...]] | None = None


def read_fade(text: str) -> tuple[float, float]:
    """Read OUT or IN,OUT; ValueError where they are no durations."""
    try:
        *fade_in, fade_out = (float(part) for part in text.split(","))
    except ValueError:
        fade_in, fade_out = [], -1.0
    if len(fade_in) > 1 or not all(0 <= seconds < 1e6 for seconds in (*fade_in, fade_out)):
        raise ValueError(f"{text[:40]!r} is no fade: seconds at the end, 0.5, or at both ends, 0.01,0.5")
    return (fade_in[0] if fade_in else 0.0), fade_out


def read_size(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT in pixels; ValueError where it is none."""
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal()) or len(text) > 20:
        raise ValueError(f"{text[:40]!r} is no size: 1280x720 say")
    return int(width), int(height)


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelOptions(FileLevelOptions):
    """Level."""

    fade_s: tuple[float, float] | None = option(
        None, "Fade out over the last seconds, or in and out: 0.01,0.5.", "--fade", metavar="[IN,]OUT", read=read_fade
    )
    pascals: bool = option(False, "Do not scale: 1.0 in the file is 1 Pa.")
    tail_db: float = option(
        -60.0,
        "Ring on after the last step, without physics, at most 10 s, until it is that far below the peak: -60; 0: not.",
        "--tail",
        metavar="DB",
    )
    scale_json: bool = option(False, "Also write the scale as JSON, to NAME.EXT.json.")


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundtrackOptions(Options):
    """Stems and events."""

    stems: str | None = option(None, "Also write a sound a body, which add up to the mix.", metavar="DIR")
    stem_peak_dbfs: float | None = option(
        None, "Scale each stem to a peak of its own.", metavar="DB", least=-200, most=0, unset="all as the mix is"
    )
    stem_lufs: float | None = option(
        None, "Scale each stem to a loudness of its own.", metavar="L", least=-200, most=200
    )
    events: str | None = option(
        None,
        "Also write every impact, roll and slide: when, who, where, how strong, how loud.",
        metavar="NAME.json|csv",
    )
    cues: bool = option(False, "Mark events in the WAV, and in stems, as cue points.")
    time_reference_s: float | None = option(
        None,
        "With --cues: where on your timeline the file begins, in s, 30 years at most.",
        "--time-reference",
        metavar="S",
        least=0,
        most=1_000_000_000,
        unset="0",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions(Options):
    """Session for an editor."""

    folder: str | None = option(
        None,
        "Write mix, stems and events as a folder that an editor opens: OTIO (extra: session) and Reaper.",
        "--session",
        metavar="DIR",
    )
    film_fps: str | None = option(
        None,
        "With --session: a film in it, too.",
        "--film",
        metavar="[FPS]",
        bare="30",
        unset="none; alone: 30 a second",
    )
    film_size: tuple[int, int] | None = option(
        None, "Of that film's pictures.", metavar="WxH", read=read_size, unset="1280x720"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeOptions(Options):
    """Takes, and values set by hand."""

    takes: int | None = option(
        None,
        "Write N takes, NAME-01.wav …, of other surfaces, contact places and materials; the first is the render "
        "itself. Motion stays.",
        metavar="N",
        least=1,
        most=999,
    )
    take: int | None = option(None, "The K-th of these alone, with all other outputs.", metavar="K", least=1)
    vary: str | None = option(
        None, "What takes differ in: surfaces, places, materials.", metavar="WHAT,…", unset="all three"
    )
    footprint_mm: float | None = option(
        None,
        "How far contact places move, in mm.",
        "--footprint",
        metavar="MM",
        least=0,
        most=1000,
        unset="as far as Bullet takes two points for one",
    )
    roughness: tuple[str, ...] = option(
        (), "Rms height of the surface of the body NAME, or of all, in µm.", metavar="[NAME=]UM"
    )
    gain: tuple[str, ...] = option((), "Hear the body NAME louder by DB, -6 say.", metavar="NAME=DB")
    page: str | None = option(
        None,
        "Also write a page that opens offline: the scene moves and sounds, events are heard alone; with --takes: a "
        "player a take.",
        metavar="NAME.html",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpaceOptions(Options):
    """Where one listens, and with what."""

    ambisonics: int | None = option(
        None,
        "Each microphone hears directions: 4, 9 or 16 channels of ambiX (ACN, SN3D).",
        metavar="ORDER",
        least=1,
        most=3,
    )
    head: str | None = option(
        None, "Each microphone is a head: two channels through its responses. Extra: head.", metavar="FILE.sofa"
    )
    facing: Point | None = option(
        None, "Where ambisonics and heads look, in the world, in m.", metavar="X,Y,Z", unset="along x"
    )
    directivity: bool = option(
        False, "Each mode sounds as it does on that side of its body.", unset="as its mean over all sides"
    )
    microphone_path: tuple[str, ...] = option(
        (),
        "A microphone that moves: rows of time in s, x, y, z in m, and x, y, z, w of how it is turned.",
        metavar="FILE.csv",
    )
    microphone_on: tuple[str, ...] = option(
        (), "A microphone that moves with the body NAME, at X,Y,Z of its frame, in m.", metavar="NAME[=X,Y,Z]"
    )
    contact_microphone: tuple[str, ...] = option(
        (),
        "A microphone that touches the body NAME at X,Y,Z of its frame, in m, and gives its acceleration along "
        "DX,DY,DZ, in m/s².",
        metavar="NAME[=X,Y,Z[,DX,DY,DZ]]",
        unset="0,0,0,0,0,1",
    )
    vibrometer: tuple[str, ...] = option(
        (), "The same as a vibrometer, which gives its velocity, in m/s.", metavar="NAME[=X,Y,Z[,DX,DY,DZ]]"
    )
    contact_response: str | None = option(
        None,
        "Response of contact microphones: rows of Hz and factor, or a FIR filter.",
        metavar="FILE.csv|.wav",
        unset="flat",
    )
    contact_noise: float | None = option(None, "Their own noise, in m/s² per √Hz.", metavar="M_S2_RTHZ", unset="none")


@dataclass(frozen=True, slots=True, kw_only=True)
class RoomOptions(Options):
    """Room."""

    room: str | None = option(
        None,
        "Hear it in a box of that size along x, y and z, in m: echoes, then a tail. Extra: room.",
        metavar="LxWxH",
        unset="free air",
    )
    absorption: str | None = option(
        None,
        "Fraction of energy that the walls keep, above 0, at most 1: one number, or one an octave from 125 Hz on.",
        metavar="A[,…]",
        unset=f"{DEFAULT_ABSORPTION}",
    )
    room_corner: Point | None = option(
        None,
        "The room's corner of least x, y, z, in m.",
        metavar="X,Y,Z",
        unset="the scene in its middle, on its floor",
    )
    response: str | None = option(
        None,
        "Hear it in the room of a measured impulse response, of one channel, or one a microphone; direct sound stays "
        "as it is.",
        metavar="FILE.wav",
    )


def json_option() -> str | None:
    """Make the field of --json, alike in all commands: a path, or "-" for standard output."""
    return option(
        None, "Write the result as JSON to PATH.json, or alone to stdout.", "--json", metavar="[PATH.json]", bare="-"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderOptions(Options):
    """Outputs."""

    output: str | None = option(
        None,
        f"Sound file: {' '.join(AUDIO_FORMATS)}; it says what its full scale is in Pa. Not needed with --session.",
        "-o",
        "--output",
        metavar="NAME.wav",
    )
    contacts: str | None = option(
        None, "Also write the contact log, which renders again without PyBullet.", metavar="NAME.npz"
    )
    models: str | None = option(
        None,
        "Where that log's modal models are: in it, or in the cache, which makes it small.",
        choices=("included", "reference"),
        unset="included",
    )
    picture: str | None = option(None, "Also draw pressure, spectrogram and events.", metavar="NAME.png")
    json_to: str | None = json_option()
    scene: RenderSceneOptions = group(RenderSceneOptions)
    level: LevelOptions = group(LevelOptions)
    soundtrack: SoundtrackOptions = group(SoundtrackOptions)
    session: SessionOptions = group(SessionOptions)
    takes: TakeOptions = group(TakeOptions)
    space: SpaceOptions = group(SpaceOptions)
    room: RoomOptions = group(RoomOptions)
