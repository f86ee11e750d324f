"""``memo exec``: run a file of robot code in the sandbox in a task's scene, to try out skills."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, Seed, load
from memo_core.cli.output import note, print_json, while_read
from memo_core.cli.signal_handling import INTERRUPTED, Interrupt, handling
from memo_core.cli.standard_input import text_of_stdin
from memo_core.errors import InvalidArgument, MemoError
from memo_core.text.parsing import read_at_most

_MOST_BYTES = 50 << 20

if TYPE_CHECKING:
    from memo_core.interfaces.link import Link


@attrs.define(auto_exc=True, eq=False)
class CodeEnded(MemoError):
    """Robot code that did not run to its end; ``problem`` is the sandbox's error."""

    file: str
    problem: str
    exit_code: int = 1

    def __str__(self) -> str:
        return f"{self.file}: {self.problem}"


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Robot code; - reads it from stdin.")],
    task: Annotated[str | None, typer.Option("--task", "-t", help="The task whose scene it runs in.")] = None,
    seed: Seed = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Run a file of robot code in a task's scene, in the sandbox.

    Exit code 0 only when the code ran to its end, whatever the task's success check says. The code's output goes to
    stdout; the verdict of the success check, the scene's joints and locks, a refusal or an error to stderr.
    """
    code = _read(file)
    _, experiment = load(config, overrides, task, seed)
    if experiment.task is None:
        raise InvalidArgument("--task", "which scene?", "the name of a task (memo tasks list)")
    from memo_core.environment.task_verification import hidden_now, mechanics, run_code
    from memo_core.runs.factories import environment_of, sandbox_of, task_of
    from memo_core.sandbox.execution import refused

    chosen = task_of(experiment, experiment.task)
    with sandbox_of(experiment) as sandbox:
        findings = sandbox.check(code)
        if findings and not json:
            # Refused code costs nobody the building of a scene.
            raise CodeEnded(str(file), refused(findings).error)
        with environment_of(experiment, chosen, experiment.seed) as world, stopping(world.link):
            execution = run_code(world, code, sandbox, on_print=None if json else _print_now)
            outcome, moved = world.check(), mechanics(world)
            error = execution.error + hidden_now(execution.error, world)
    if json:
        print_json(
            {
                "task": chosen.name,
                "seed": experiment.seed,
                "ended": execution.ended,
                "error": error or None,
                "kind": execution.kind or None,
                "line": execution.line,
                "printed": execution.printed,
                "calls": len(execution.calls),
                "success": outcome.success,
                "reason": outcome.reason,
                **moved,
            }
        )
    else:
        verdict = "done" if outcome.success else "not done"
        note(f"memo: {chosen.name}, seed {experiment.seed}: {verdict} ({outcome.reason})")
        joints = [f"{name} {at:.4f}" for name, at in moved["joints"].items()]
        locks = [f"{name} {'engaged' if engaged else 'released'}" for name, engaged in moved["locks"].items()]
        for kind, told in (("joints (rad, m)", joints), ("locks", locks)):
            if told:
                note(f"memo: {kind}: {', '.join(told)}")
    if not execution.succeeded:
        stopped = execution.ended == "stopped"
        raise CodeEnded(str(file), error or execution.ended, INTERRUPTED if stopped else 1)


def _read(file: Path) -> str:
    if str(file) == "-":
        return text_of_stdin(_MOST_BYTES)
    try:
        return read_at_most(file, _MOST_BYTES).decode("utf-8")
    except UnicodeDecodeError:
        raise InvalidArgument("FILE", f"{file} is not UTF-8 text", "a file of robot code") from None
    except ValueError as error:
        raise InvalidArgument("FILE", f"{file} {error}", "a file of robot code") from None
    except OSError as error:
        raise InvalidArgument("FILE", f"{file}: {error.strerror}", "a file of robot code") from None


def _print_now(text: str) -> None:
    with while_read():  # that nobody reads on is no reason to leave the robot half-way
        sys.stdout.write(text)


@contextmanager
def stopping(link: Link) -> Iterator[None]:
    """A first signal stops the robot; a second one is an ``Interrupt``."""
    interrupt = Interrupt()

    def stop(*_: Any) -> None:
        if link.stopped:
            interrupt()
        link.stop()

    with handling(stop):
        yield
