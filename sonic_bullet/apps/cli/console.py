"""Run a command line and convert its result to an exit code.

0 done | 2 a named error, in one line | 130 Ctrl-C | 143 terminated | 141 the reader left

A standard stream that is closed (`>&-`) is opened to nowhere before anything else is: what is printed is lost, which is
told, and no file that the command writes gets the stream's number.
"""

from __future__ import annotations

import errno
import io
import os
import stat
import sys
import warnings
from typing import Any, NoReturn

import click

from sonic_bullet.machine.supervisor import run_supervised
from sonic_bullet.machine.worker import kept_words, stop_word
from sonic_bullet.records.errors import (
    DensityWarning,
    MaterialWarning,
    RestitutionWarning,
    SizeWarning,
    SonicBulletError,
    interrupts,
)


def run_and_exit(cli: click.Group) -> NoReturn:
    """Run the command that the command line asks for, in a child process, and exit."""
    closed = open_closed_streams()
    quick = ("cache", "case", "materials")  # Commands that take long only on a busy machine, and report no progress
    word = "" if {"-h", "--help"} & set(sys.argv) or not cli.commands.keys() & set(sys.argv[1:2]) else sys.argv[1]
    if 1 in closed and sys.argv[1:]:
        _say("note: standard output is closed: what would be printed there is lost")
    ending = run_supervised(lambda: _run(cli), command="" if word in quick else word)
    if ending.words:
        _say(ending.words)
    sys.exit(ending.code)


def open_closed_streams() -> set[int]:
    """Open to nowhere the standard streams that are closed; return their numbers.

    Python has None in their place, and the next file or pipe that is opened would get their numbers.
    """
    closed = set[int]()
    for number, name, how in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            closed.add(number)
            opened = os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one, as those below are open
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            os.set_inheritable(number, True)
            stream = open(number, how, encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115 - until the end
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)
    return closed


def _run(cli: click.Group) -> int:
    """Run the command, turn every error into one line on stderr; return the exit code."""
    import logging

    debug = bool(os.environ.get("SONIC_BULLET_DEBUG"))
    if not debug:
        warnings.simplefilter("ignore")  # a library's warning is not for the user
        _show_warnings()
        logging.getLogger("matplotlib").setLevel(logging.ERROR)  # nor a missing folder for its fonts
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters still gets its table
    try:
        # cli.main() would drop the message of an interrupt
        with (
            interrupts(),
            cli.make_context("sonic-bullet", _complete_json_options(sys.argv[1:]) or ["--help"]) as context,
        ):
            cli.invoke(context)
        _say_what_is_not_kept()
        code = 0
    except click.exceptions.Exit as done:
        code = done.exit_code
    except KeyboardInterrupt as error:
        code = _report_stop(str(error))
    except click.ClickException as error:
        where = getattr(error, "ctx", None)
        code, hint = 2, f"; see '{where.command_path} --help'" if where is not None else ""
        _say(error.format_message().rstrip(".") + hint)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the reader left; flushing at exit must not complain
        code = 141
    except Exception as error:
        if debug:
            raise
        code = _report_unprinted(error) if _is_of_stdout(error) else _report_error(error)
    return code if code else _flush_output()


def _is_of_stdout(error: Exception) -> bool:
    """Tell whether it is of standard output: a file on a full disk, or a device that takes no further line."""
    full_or_broken = (errno.ENOSPC, errno.EIO, errno.EBADF)
    if not isinstance(error, OSError) or error.filename is not None or error.errno not in full_or_broken:
        return False
    try:
        kind = os.fstat(1).st_mode
        if stat.S_ISREG(kind):
            return os.fstatvfs(1).f_bavail == 0
        if stat.S_ISCHR(kind) and not os.isatty(1):
            os.write(1, b"\n")
    except OSError:
        return True
    return False


def _report_unprinted(error: Exception) -> int:
    """Report that standard output takes no more; return the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # flushing at exit must not complain
    _say(f"standard output cannot be written: {getattr(error, 'strerror', None) or error}; what was printed is lost")
    return 2


def _flush_output() -> int:
    """Write what is still to be printed; return 0, 141 where the reader left, 2 where it cannot be written."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 141
    except OSError as error:
        return _report_unprinted(error)
    return 0


def _show_warnings() -> None:
    """Print what is warned of materials and bodies, a line each and once, at once; other warnings stay as they are."""
    heads = {MaterialWarning: "warning", SizeWarning: "note", DensityWarning: "note", RestitutionWarning: "note"}
    usual, shown = warnings.showwarning, set[str]()

    def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if category not in heads:
            usual(message, category, *where)
        elif str(message) not in shown:
            shown.add(str(message))
            _say(f"{heads[category]}: {message}")

    for category in heads:
        warnings.simplefilter("always", category)
    warnings.showwarning = show  # type: ignore[assignment]


def _report_error(error: Exception) -> int:
    """Report an error; return the exit code."""
    if stop_word():  # an interrupt that became another exception
        return _report_stop()
    if isinstance(error, SonicBulletError):
        _say(str(error))
        return 2
    notes = "; ".join(getattr(error, "__notes__", []))
    _say(
        f"{type(error).__name__}: {error}" + (f"; {notes}" if notes else "") + "; set SONIC_BULLET_DEBUG=1 to see where"
    )
    return 2


def _report_stop(words: str = "") -> int:
    """Report that the command was interrupted; return the exit code."""
    words = words or stop_word() or "stopped"
    _say(f"{words}; {kept_words()}" if kept_words() else words)
    return 143 if "terminated" in (stop_word(), words.partition(";")[0]) else 130


def _complete_json_options(words: list[str]) -> list[str]:
    """Replace every --json that no name ending in .json follows by --json=-, as another argument follows it then."""
    follows = [*words[1:], ""]
    return [
        "--json=-" if word == "--json" and not after.lower().endswith(".json") else word
        for word, after in zip(words, follows, strict=True)
    ]


def _say_what_is_not_kept() -> None:
    """Report, once, that there is no folder for computed models, and what that costs: each run computes them anew."""
    folder = sys.modules.get("sonic_bullet.files.storage.user_folder")
    if folder is not None and folder.notes:
        took = os.times()
        spent_s = took.user + took.system + took.children_user + took.children_system
        _say(
            f"note: computed models are not kept for the next run: {folder.notes[0]}; every run computes them anew, of "
            f"{spent_s:.0f} s of processor time here; XDG_CACHE_HOME or SONIC_BULLET_CACHE names another folder"
        )


def _say(text: str) -> None:
    """Print one line on stderr."""
    print("sonic-bullet: " + " ".join(text.split()), file=sys.stderr)
