"""The tree of commands. Only the module of the invoked command is imported; the help shows one line of each.

A plugin adds a command with an entry point in the group ``memo.commands``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.metadata import EntryPoint
from types import FunctionType
from typing import Annotated

import typer

from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.plugins.entry_points import installed, summary_of

# name -> the line in the help. Its module has an ``app`` (a group of commands) or one ``command``.
COMMANDS = {
    "run": "Run a task: plan, write code, move, listen, remember.",
    "demo": "Teach the simulated arm once and watch the lesson carry over.",
    "see": "Look once, and show what perception makes of it.",
    "exec": "Run a file of robot code in a task's scene, in the sandbox.",
    "study": "Participants teach the robot in sessions.",
    "evaluate": "Compare methods on tasks that nobody taught.",
    "report": "Tables, figures and a page about an experiment or a run.",
    "reproduce": "Study, evaluation and report in one command.",
    "tasks": "The tasks there are, and whether they can be done.",
    "cluster": "Condense what people taught: fewer notes, none lost.",
    "new": "Begin a plugin of your own, of any kind: one that works.",
    "skills": "Functions that robot code may call, learnt ones too.",
    "skillbook": "List, search, edit and export the entries of a skillbook.",
    "config": "Experiment files: explain, show, check, schema, preset.",
    "plugins": "Plugins and their backends.",
    "prompts": "The texts that are sent to language models.",
    "llm": "Whether the language model works, and what an experiment costs.",
    "budget": "What the runs that share a ledger have spent on language models.",
    "robot": "A real robot: check it, move it slowly, take it out of an error.",
    "doctor": "What works on this machine, and what would make the rest work.",
}
MODULES = {name: f"memo_core.cli.{name}" for name in COMMANDS} | {"exec": "memo_core.cli.execute"}


def run_app(arguments: list[str]) -> int:
    """Run one command and return its exit code. ``MemoError`` and ``KeyboardInterrupt`` are left to the caller."""
    # `--debug` is wanted most when the command has already been typed, so it may stand anywhere.
    arguments = [argument for argument in arguments if argument != "--debug"]
    typed = next((argument for argument in arguments if not argument.startswith("-")), "")
    try:
        _tree(typed)(arguments, prog_name="memo")
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            raise KeyboardInterrupt from None
        return ended.code if isinstance(ended.code, int) else int(bool(ended.code))
    return 0


def _tree(typed: str) -> typer.Typer:
    tree = typer.Typer(
        name="memo",
        help="MEMO: a robot arm keeps what people tell it.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # Rich would take as long to import as everything else together
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    tree.callback()(_options)
    for name, line in COMMANDS.items():
        if name != typed:
            tree.command(name, help=line)(_untyped)
            continue
        module = importlib.import_module(MODULES[name])
        if hasattr(module, "app"):
            tree.add_typer(module.app, name=name, help=line, no_args_is_help=True)
        else:
            tree.command(name, short_help=line)(module.command)
    points = plugin_commands()
    if typed and typed not in COMMANDS and typed not in {point.name for point in points}:
        from memo_core.plugins.not_installed import CommandNotInstalled, offering_command

        if offered := offering_command(typed):
            raise CommandNotInstalled(typed, offered)
    for point in points:
        if point.name in COMMANDS:
            continue  # a plugin cannot take the place of a command of the core
        if point.name == typed:
            _add(tree, point, _load(point))
        else:
            tree.command(point.name, help=_summary(point))(_untyped)
    return tree


def _add(tree: typer.Typer, point: EntryPoint, loaded: typer.Typer | Callable[..., None]) -> None:
    """Add a plugin's group of commands, or its only one."""
    if isinstance(loaded, typer.Typer):
        tree.add_typer(loaded, name=point.name, help=_summary(point), no_args_is_help=True)
    else:
        tree.command(point.name, short_help=_summary(point))(loaded)


def plugin_commands() -> list[EntryPoint]:
    """Commands of plugins: the entry points of the group ``memo.commands``, by name. Only metadata is read, so that
    ``memo --help`` stays fast; of two with the same name the first distribution's is used."""
    found = sorted(installed("memo.commands")[0], key=lambda point: (point.name, point.value))
    return list({point.name: point for point in reversed(found)}.values())[::-1]


def _summary(point: EntryPoint) -> str:
    about = summary_of(point)
    return str(about or f"of {point.value}").partition(": ")[2] or str(about)


def _load(point: EntryPoint) -> typer.Typer | Callable[..., None]:
    from memo_core.plugins.loading import one_line
    from memo_core.plugins.registry import BrokenCommand

    try:
        app = point.load()
        if not isinstance(app, (typer.Typer, FunctionType)):
            raise TypeError(f"it is a {type(app).__name__}, expected a typer.Typer or a function")
        group = typer.Typer()
        _add(group, point, app)
        typer.main.get_command(group)  # what Typer cannot make a command of is found here, where the plugin is known
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module that exits, too
        raise BrokenCommand(point.name, point.value, one_line(error)) from error
    return app


def _untyped() -> None:
    """Placeholder for a command that was not invoked; it is listed, never called."""


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"memo {version('memo-core')}")
        raise typer.Exit()


def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass
