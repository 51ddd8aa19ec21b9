"""Build the package as a wheel, install it into a folder, and run tests against what stands there.

    python -m tools.installed_tests FOLDER [--sanitized | --wheel FILE] TEST...

--wheel: one that is there is tested, none is built. The folder gets an environment without the checkout's own package:
what a user who installs the wheel has. --sanitized: the engine is built with address and undefined-behaviour
sanitizers and checks every index; the first fault ends the run.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
SANITIZERS = {
    # CPython and NumPy keep what they once allocated: leaks are not looked for
    "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1",
    "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
}


def main() -> int:
    """Do as the module says; return pytest's exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sanitized", action="store_true")
    parser.add_argument("--wheel", type=Path)
    parser.add_argument("tests", nargs="+")
    given = parser.parse_args()
    folder = given.folder.resolve()
    python = environment(folder)
    install(folder, given.wheel or REPO, sanitized=given.sanitized)
    command: list[str | Path] = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--import-mode=importlib"]
    # the settings are the checkout's, but its package is not what is imported
    command += ["-c", REPO / "pyproject.toml", f"--rootdir={folder / 'site'}", "-o", f"pythonpath={folder / 'site'}"]
    command += ["-m", "not slow", *given.tests]
    variables = os.environ | {"PYTHONPATH": str(folder / "site")}
    if given.sanitized:
        libraries = [compilers_file(name) for name in ("libasan.so", "libubsan.so")]
        variables |= SANITIZERS | {"LD_PRELOAD": " ".join(libraries)}
    return subprocess.run(command, cwd=folder / "site", env=variables, check=False).returncode


def environment(folder: Path) -> Path:
    """Make an environment that has this one's packages, but not what is installed of a checkout; return its Python."""
    place = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place], check=True)
    packages = sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)})
    # a folder that a .pth file names has its own .pth files left alone: an editable install among them does nothing
    others = [path for path in sys.path if Path(path).name in {"site-packages", "dist-packages"}]
    (Path(packages) / "others.pth").write_text("".join(f"{path}\n" for path in others))
    return place / ("Scripts" if os.name == "nt" else "bin") / "python"


def install(folder: Path, what: Path, *, sanitized: bool) -> None:
    """Install a wheel, or one made of a checkout, into ``folder``/site, beside this checkout's tests."""
    site, settings = folder / "site", []
    if sanitized:
        settings = [f"-Cbuild-dir={folder / 'build'}", "-Ccmake.define.ENGINE_SANITIZED=ON"]
        settings += ["-Ccmake.build-type=RelWithDebInfo"]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-deps", "--upgrade"]
    if importlib.util.find_spec("scikit_build_core"):  # what another environment has compiled is not taken up
        pip += ["--no-build-isolation"]
    subprocess.run([*pip, "--target", site, *settings, what], check=True)
    for name in ("tests", "scenes", "assets", "benchmarks", "docs", "studies", "tools", "examples"):
        link = site / name
        if not link.is_symlink():
            link.symlink_to(REPO / name)


def compilers_file(name: str) -> str:
    """Return the path of a library of the compiler's."""
    asked = [os.environ.get("CXX", "g++"), f"-print-file-name={name}"]
    return subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
