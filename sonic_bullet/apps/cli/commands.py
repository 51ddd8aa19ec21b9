"""Commands made of records of options (`sonic_bullet.options`): what they parse, and their help.

record -> an option a field, a heading a group -> words -> record -> function(arguments, record)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, fields
from functools import cached_property
from importlib import import_module
from math import isnan
from typing import Any, get_args, get_origin

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.options.option import Option, Options, flag_of, option_of, own_type


class Numbers(click.ParamType):  # type: ignore[type-arg,unused-ignore]  # generic since click 8.3
    """As many finite numbers, separated by commas, as its name has, such as ``X,Y,Z``."""

    def __init__(self, name: str) -> None:
        self.name, self.count = name, name.count(",") + 1

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers in ``value``; click's usage error where there are not that many finite ones."""
        try:
            numbers = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != self.count or not all(abs(number) < float("inf") for number in numbers):
            self.fail(f"{value!r} is not {self.name}: {self.count} finite numbers with commas between", param, ctx)
        return numbers


class BoundedNumber(click.FloatRange):
    """A number within bounds, which NaN is not."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number; click's usage error where it is none."""
        number = float(super().convert(value, param, ctx))
        if isnan(number):
            self.fail(f"{value!r} is no number.", param, ctx)
        return number


class Text(click.ParamType):  # type: ignore[type-arg,unused-ignore]  # generic since click 8.3
    """A text that an option's own function reads."""

    def __init__(self, name: str, read: Callable[[str], Any]) -> None:
        self.name, self.read = name, read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return what is read; click's usage error where it is not valid."""
        try:
            return self.read(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class RecordCommand(click.Command):
    """A command that calls a function with its arguments and a record of its options.

    module: of `sonic_bullet.options`; the record in it is that of the function's last argument.
    """

    def __init__(
        self, name: str, function: Callable[..., None], module: str, arguments: tuple[str, ...], epilog: str | None
    ) -> None:
        super().__init__(name, callback=self._call, help=function.__doc__, epilog=epilog)
        self.function, self.module, self.arguments = function, module, arguments
        self.kinds = {name: kind for name, kind in function.__annotations__.items() if name != "return"}
        self.headings: list[tuple[str, list[click.Parameter]]] = []

    @cached_property
    def record(self) -> type[Options]:
        """The record of its options, imported when it is first needed: the list of all commands is shown without."""
        found: type[Options] = Options
        if self.module:
            found = getattr(import_module(f"sonic_bullet.options.{self.module}"), [*self.kinds.values()][-1])
        return found

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Make arguments and options when they are first needed."""
        if not self.headings:
            arguments = [_argument(*one, how) for one, how in zip(self.kinds.items(), self.arguments, strict=False)]
            self.headings = [(title, [*made]) for title, made in _headings(self.record)]
            self.params = [*arguments, *(one for _, some in self.headings for one in some)]
        return super().get_params(ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, each group under its heading."""
        last = self.get_help_option(ctx)
        named = [*self.headings[1:], self.headings[0]] if not self.headings[0][1] else self.headings
        for number, (title, options) in enumerate(named):
            shown = [*options, *([last] if last is not None and number == 0 else [])]
            with formatter.section(title):
                formatter.write_dl([record for one in shown if (record := one.get_help_record(ctx)) is not None])

    def _call(self, **values: Any) -> None:
        arguments = [values.pop(one.name) for one in self.params if isinstance(one, click.Argument)]
        self.function(*arguments, *([_record(self.record, values)] if self.module else []))


def command(
    module: str = "", *arguments: str, name: str = "", examples: str = ""
) -> Callable[[Callable[..., None]], RecordCommand]:
    """Make a command of a function: the metavars of its arguments, and the module of the record of its options.

    examples: name in `EXAMPLES`, where it is not the command's.

    An argument of type ``tuple[str, ...]`` takes all words, a metavar in brackets may be left out.
    """

    def made(function: Callable[..., None]) -> RecordCommand:
        called = name or function.__name__
        return RecordCommand(called, function, module, arguments, EXAMPLES.get(examples or called))

    return made


def _argument(name: str, kind: str, metavar: str) -> click.Argument:
    many = -1 if kind.startswith("tuple") else 1
    return click.Argument([name], nargs=many, required=not metavar.startswith("["), metavar=metavar)


def _headings(
    record: type[Options], path: str = "", title: str = "Options"
) -> Iterator[tuple[str, list[click.Option]]]:
    """Yield a heading and its options: those of the record, then of each group in it."""
    yield title, [_option(record, one, path, about) for one in fields(record) if (about := option_of(one)) is not None]
    for one in fields(record):
        if (inner := _group(one)) is not None:
            yield from _headings(inner, f"{path}{one.name}__", (inner.__doc__ or "").partition(".")[0])


def _group(one: Field[Any]) -> type[Options] | None:
    """Return the record of a group; None of another field."""
    made = one.default_factory
    return made if isinstance(made, type) and issubclass(made, Options) else None


def _option(record: type[Options], one: Field[Any], path: str, about: Option) -> click.Option:
    kind = about.words or own_type(record, one.name) if about.read is None else str
    repeated = get_origin(kind) is tuple and get_args(kind)[-1] is ...
    kind = get_args(kind)[0] if repeated else kind
    flags = list(about.flags) or [flag_of(one)]
    how: dict[str, Any] = {"metavar": about.metavar or ("N" if kind is int else None), "multiple": repeated}
    if kind is bool:
        flags, how = ([f"{flags[0]}/--no-{flags[0][2:]}"], {}) if one.default is None else (flags, {"is_flag": True})
    elif about.read is not None:
        how["type"] = Text(about.metavar or "TEXT", about.read)
    elif get_origin(kind) is tuple:
        how["type"] = Numbers(about.metavar or "")
    elif about.choices:
        how["type"] = click.Choice(about.choices)
    elif about.bounds:
        of: Any = click.IntRange if kind is int else BoundedNumber
        how["type"] = of(about.least if about.above is None else about.above, about.most, about.above is not None)
    else:
        how["type"] = kind
    if about.bare is not None:
        how |= {"is_flag": False, "flag_value": about.bare}
    help_text = f"{about.help[:-1]}; repeatable." if repeated else about.help
    if default := about.unset or _format_default(one.default):
        help_text += f" [default: {default}]"
    how |= {"required": True} if one.default is MISSING else {"default": None}  # a None is a value to click 8.5
    return click.Option([*flags, path + one.name], help=help_text, **how)


def _format_default(default: Any) -> str:
    """Write a default as help shows it; "" for one that is nothing."""
    if default in (None, MISSING, False, "", ()):
        return ""
    return f"{default:g}" if isinstance(default, float) else str(default)


def _record(record: type[Options], values: dict[str, Any], path: str = "") -> Options:
    """Build a record of what was parsed; what was not given is the record's default."""
    found: dict[str, Any] = {}
    for one in fields(record):
        if (inner := _group(one)) is not None:
            found[one.name] = _record(inner, values, f"{path}{one.name}__")
        elif (value := values.get(path + one.name)) not in (None, ()):
            found[one.name] = value
    made: Options = getattr(record, "from_words", record)(**found)
    return made
