"""Records of options: what one says holds on the command line, in help and in Python."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import Field, dataclass, fields
from typing import Any

import click
import pytest

from sonic_bullet.apps.cli import case, cli
from sonic_bullet.apps.cli.commands import RecordCommand
from sonic_bullet.options.option import Option, Options, flag_of, given_flags, group, option, option_of, takes
from sonic_bullet.options.render import LevelOptions, RenderOptions, RenderSceneOptions
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.scene import render_scene

COMMANDS = [one for one in [*cli.commands.values(), *case.commands.values()] if isinstance(one, RecordCommand)]


def options_in(record: type[Options]) -> Iterator[tuple[type[Options], Field[Any], Option]]:
    """Every option of a record and its groups, with the record that it stands in."""
    for one in fields(record):
        about = option_of(one)
        if about is not None:
            yield record, one, about
        elif isinstance(one.default_factory, type) and issubclass(one.default_factory, Options):
            yield from options_in(one.default_factory)


ALL = [(made, *one) for made in COMMANDS for one in options_in(made.record)]


def parsed(made: click.Command, *words: str) -> Any:
    """The record that a command is called with."""
    assert isinstance(made, RecordCommand)
    kept: list[Any] = []
    function, made.function = made.function, lambda *given: kept.extend(given)
    try:
        with made.make_context(made.name, list(words)) as context:
            made.invoke(context)
    finally:
        made.function = function
    return kept[-1]


def test_every_option_of_a_record_is_on_its_command_line_with_its_help() -> None:
    for made in COMMANDS:
        text = " ".join(made.get_help(click.Context(made, info_name=made.name, max_content_width=500)).split())
        mine = [(one, about) for it, _, one, about in ALL if it is made]
        flags = [flag_of(one) for one, _ in mine]
        assert len(set(flags)) == len(flags)
        for one, about in mine:
            assert flag_of(one) in text
            assert " ".join(about.help.split()).removesuffix(".") in text
            assert about.unset in text
    assert len(ALL) > 200


def test_what_is_not_given_is_the_default_of_the_record() -> None:
    assert parsed(cli.commands["render"], "a.py") == RenderOptions(scene=parsed(cli.commands["render"], "a.py").scene)
    assert parsed(cli.commands["render"], "a.py").level == LevelOptions()
    given = parsed(cli.commands["render"], "a.py", "--tail", "-30", "--fade", "0.1,2", "--silent", "a", "--silent", "b")
    assert given.level == LevelOptions(tail_db=-30.0, fade_s=(0.1, 2.0))
    assert given.scene.silent == ("a", "b")
    assert given_flags(given.level) == ["--fade", "--tail"]


def test_bounds_hold_on_the_command_line_and_in_python() -> None:
    checked = 0
    for made, record, one, about in ALL:
        if not about.bounds:
            continue
        beside = ((about.above, 0), (about.least, -1), (about.most, 1))
        needed = [x for x in fields(record) if option_of(x) and x.default is x.default_factory]
        required = {x.name: 1 if x.type == "int" else "a" for x in needed}
        for value in (bound + side for bound, side in beside if bound is not None):
            number = int(value) if "int" in str(one.type) else float(value)
            with pytest.raises(SonicBulletError, match=one.name):
                record(**required | {one.name: number})
            arguments = [flag_of(one), str(number)]
            with pytest.raises(click.UsageError) as refused, click.Context(made) as context:
                made.parse_args(context, arguments)
            assert flag_of(one) in refused.value.format_message()
            checked += 1
    assert checked > 40


def test_a_function_takes_a_record_as_keywords_and_says_its_options() -> None:
    signature = inspect.signature(render_scene)
    assert [*signature.parameters] == ["path", *(one.name for one in fields(RenderSceneOptions))]
    assert signature.parameters["seed"].kind is inspect.Parameter.KEYWORD_ONLY
    said = " ".join((render_scene.__doc__ or "").split())
    for one in fields(RenderSceneOptions):
        about = option_of(one)
        assert about is None or about.help in said
    with pytest.raises(TypeError, match="loud"):
        render_scene("a.py", loud=True)  # type: ignore[call-arg]


def test_a_new_option_is_one_field() -> None:
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Inner(Options):
        """Colours."""

        width_mm: float = option(2.0, "How wide, in mm.", "--width", above=0, most=9)

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Outer(Options):
        """Outputs."""

        names: tuple[str, ...] = option((), "Whose.", "--name")
        sharp: bool | None = option(None, "Edges.", unset="as drawn")
        inner: Inner = group(Inner)

    @takes(Inner)
    def draw(path: str, options: Inner) -> float:
        """Draw."""
        return options.width_mm

    def called(path: str, options: Outer) -> None:
        """Paint."""

    paint = RecordCommand("paint", called, "render", ("PATH",), None)
    vars(paint)["record"] = Outer  # as if it stood in the package
    assert parsed(paint, "x", "--name", "a", "--name", "b", "--no-sharp") == Outer(names=("a", "b"), sharp=False)
    assert parsed(paint, "x", "--width", "3").inner.width_mm == draw("x", width_mm=3) == draw(path="x", width_mm=3.0)  # type: ignore[call-arg]  # no name to a type checker
    text = paint.get_help(click.Context(paint, info_name="paint"))
    assert "Colours:\n  --width" in text
    assert "[default: 2]" in text and "[default: as drawn]" in text and "Whose; repeatable." in text
