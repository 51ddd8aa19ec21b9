"""Does a disk that fills up ever leave a bad file behind exit code 0? Every format at 40 fill levels of a small disk.

    python studies/full_disk.py [--levels 40] [--kinds .wav,.flac,…] [--json]

A tmpfs of 4 MiB is mounted in a mount namespace of its own (unshare; as root, or as a user where user namespaces are
allowed) and filled until so many bytes are left: half of the levels are spread over the file's size, half lie page by
page below it, where a format's last bytes go. Each write is the command line's (`render LOG -o …`, `materials --json
…`) in a forked process. Counted: exit 0 with the whole file, another exit without one, and bad: exit 0 without the
whole file, anything that cannot be read under the final name, a line that does not say "disk full" where the disk was
full, litter. Where nothing can be mounted all is counted as skipped. Exit 1 where anything is bad.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

AUDIO = (".wav", ".rf64", ".w64", ".flac", ".ogg", ".aif", ".aiff", ".caf")
OTHERS = (".npz", ".png", ".json", ".html", "preset")
DISK_BYTES, PAGE_BYTES = 4 << 20, 4096
FRAMES, SR = 24_000, 48_000


def mounted(arguments: list[str], disk: Path) -> list[str] | None:
    """The command that runs ``arguments`` where ``disk`` is a small tmpfs; None where nothing can be mounted."""
    inside = f'mount -t tmpfs -o size={DISK_BYTES},mode=777 none "$0" && exec "$@"'
    for flags in ("-m", "-Urm"):
        command = ["unshare", flags, "sh", "-c", inside, str(disk)]
        try:
            done = subprocess.run([*command, "true"], check=False, capture_output=True, timeout=60)
        except OSError:
            return None
        if done.returncode == 0:
            return [*command, *arguments]
    return None


def writers(folder: Path) -> dict[str, Callable[[Path], None]]:
    """Kind -> a function that writes that kind of file to a path, as the command line or the API does."""
    import numpy as np

    from sonic_bullet.apps.cli import main
    from sonic_bullet.apps.report.plots.scene_plot import render_picture
    from sonic_bullet.files import presets, replace_file, write_audio, write_log
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.records import Microphone
    from sonic_bullet.records.contacts import Contacts, Step
    from sonic_bullet.records.errors import SonicBulletError

    sound = np.random.default_rng(0).normal(0, 0.1, (2, FRAMES))
    ears = (Microphone(np.array([0.0, -1.0, 0.5])),)
    step = Step(0.01, np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, bool), Contacts.none())
    log = ContactLog((), (step,) * 50, ears, SR, 0)
    page = np.random.default_rng(1).integers(32, 127, 300_000).astype(np.uint8).tobytes()

    def api(write: Callable[[Path], object]) -> Callable[[Path], None]:
        def run(path: Path) -> None:
            try:
                write(path)
            except SonicBulletError as error:
                print(f"sonic-bullet: {error}", file=sys.stderr)
                sys.exit(2)
            sys.exit(0)

        return run

    def html(path: Path) -> None:
        with replace_file(path) as file:
            file.write(page)

    def command(path: Path) -> None:
        sys.argv = ["sonic-bullet", "materials", "--json", str(path)]
        main()

    made: dict[str, Callable[[Path], None]] = {e: api(lambda path: write_audio(path, sound, SR)) for e in AUDIO}
    made[".npz"] = api(lambda path: write_log(path, log))
    made[".png"] = api(lambda path: render_picture(path, sound, SR))
    made[".html"] = api(html)
    made["preset"] = api(lambda path: presets.write_preset(path, presets.named_preset("steel")))
    made[".json"] = command
    return made


def child(write: Callable[[Path], None], path: Path, said: Path) -> int:
    """Exit code of ``write(path)`` in a forked process, whose stderr goes to ``said``."""
    number = os.fork()
    if number == 0:
        code = 3
        try:
            with said.open("wb") as file:
                os.dup2(file.fileno(), 2)
            write(path)
        except SystemExit as done:
            code = int(done.code or 0)
        except BaseException as error:
            os.write(2, f"{type(error).__name__}: {error}".encode())
        finally:
            with contextlib.suppress(Exception):
                sys.stderr.flush()
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])


def whole(path: Path, size: int) -> bool:
    """The file can be read to its end and holds all of it."""
    if path.suffix in AUDIO:
        from sonic_bullet.files import read_audio

        try:
            sound, sr = read_audio(path)
        except Exception:
            return False
        return (sound.shape, sr) == ((2, FRAMES), SR)
    return path.stat().st_size == size


def run(disk: Path, scratch: Path, kinds: list[str], count: int) -> dict[str, dict[str, int | list[str]]]:
    """Counts by kind; to be called where ``disk`` is small."""
    made = writers(scratch)
    found: dict[str, dict[str, int | list[str]]] = {}
    for kind in kinds:
        suffix = kind if kind.startswith(".") else ".json"
        target, said = disk / f"a{suffix}", scratch / "said"
        _clear(disk)
        if child(made[kind], target, said) != 0 or not target.exists():
            raise SystemExit(f"{kind} cannot be written at all: {said.read_text()}")
        size = target.stat().st_size
        spread = [size * k // (count - count // 2) for k in range(count - count // 2)]
        levels = spread + [max(size - k * PAGE_BYTES, 0) for k in range(count // 2)]
        done, refused, bad = 0, 0, []
        for free in levels:
            _clear(disk)
            room = os.statvfs(disk)
            ballast = room.f_bavail * room.f_frsize - (free + PAGE_BYTES - 1) // PAGE_BYTES * PAGE_BYTES
            with (disk / "ballast").open("wb") as file:
                file.write(bytes(max(ballast, 0)))
            code = child(made[kind], target, said)
            there, text = target.exists(), said.read_text()
            names = {path.name for path in disk.iterdir()} - {"ballast", target.name}
            if code == 0 and there and whole(target, size):
                done += 1
            elif code == 2 and not there and "disk full" in text and len(text.splitlines()) == 1:
                refused += 1
            else:
                bad.append(f"{free} bytes free: exit {code}, {'a file' if there else 'no file'}: {text.strip()[-200:]}")
            kept = disk / f"a.partial{suffix}"
            if names - {kept.name} or (names and not _readable(kept)):
                bad.append(f"{free} bytes free: left {sorted(names)}")
        found[kind] = {"levels": len(levels), "whole": done, "refused": refused, "bad": bad}
    return found


def _clear(disk: Path) -> None:
    for path in disk.iterdir():
        path.unlink()


def _readable(path: Path) -> bool:
    from sonic_bullet.files import read_audio

    try:
        return bool(read_audio(path)[0].size)
    except Exception:
        return False


def main() -> None:
    """The figures, a line a kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=int, default=40)
    parser.add_argument("--kinds", default=",".join((*AUDIO, *OTHERS)))
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--disk", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    kinds = asked.kinds.split(",")
    if asked.disk:
        scratch = Path(tempfile.mkdtemp(prefix="full-disk-"))
        try:
            print(json.dumps(run(Path(asked.disk), scratch, kinds, asked.levels)))
        finally:
            shutil.rmtree(scratch)
        return
    with tempfile.TemporaryDirectory(prefix="small-disk-") as disk:
        command = mounted(
            [sys.executable, __file__, "--levels", str(asked.levels), "--kinds", asked.kinds, "--disk", disk],
            Path(disk),
        )
        if command is None:
            print(
                json.dumps({"skipped": len(kinds) * asked.levels})
                if asked.json
                else f"{len(kinds) * asked.levels} skipped: nothing can be mounted here"
            )
            return
        done = subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(done.returncode)
    found = json.loads(done.stdout)
    if asked.json:
        print(json.dumps(found))
    else:
        for kind, counts in found.items():
            print(
                f"{kind:7} {counts['levels']} fill levels: {counts['whole']} whole, {counts['refused']} "
                f"refused, {len(counts['bad'])} bad"
            )
            for line in counts["bad"]:
                print(f"        {line}")
    sys.exit(any(counts["bad"] for counts in found.values()))


if __name__ == "__main__":
    main()
