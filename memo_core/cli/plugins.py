"""``memo plugins``: lists installed and broken plugins, and runs the conformance suite on a backend."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import note, print_json, print_table, print_wrapped
from memo_core.errors import InvalidArgument, MemoError

if TYPE_CHECKING:
    from memo_core.interfaces.backend import Backend
    from memo_core.testing.robot_check.trial import RobotTrial

LIST_WIDTH = 120  # columns in a pipe, beyond which a line goes on in the next

app = typer.Typer(help="Plugins and their backends.")


@app.command("list")
def list_plugins(json: Json = False) -> None:
    """List plugins, their backends, and their problems."""
    from memo_core.interfaces.backend import KINDS
    from memo_core.plugins.registry import Registry

    registry = Registry()
    backends = [backend for kind in KINDS for backend in registry.backends(kind)]
    if json:
        print_json(
            {
                "plugins": [
                    {
                        "name": plugin.name,
                        "distribution": plugin.distribution,
                        "version": plugin.version,
                        "module": plugin.module,
                        "listens": plugin.listens,
                        "error": plugin.error or None,
                    }
                    for plugin in registry.plugins
                ],
                "backends": [_as_json(backend, registry.plugin_of(backend).distribution) for backend in backends],
                "problems": list(registry.problems),
                "not_installed": [
                    {
                        "distribution": one.distribution,
                        "offers": [{"kind": kind, "name": name} for kind, name in one.offers],
                        "command": one.command,
                    }
                    for one in registry.uninstalled()
                ],
            }
        )
        return
    print_table(
        ("kind", "backend", "", "distribution", "summary"),
        [
            (b.kind, b.name, "default" if b.default else "", registry.plugin_of(b).distribution, b.summary)
            for b in backends
        ],
        width=LIST_WIDTH,
    )
    for backend in backends:
        if missing := _missing(backend):
            print_wrapped(f"{backend.kind} {backend.name} needs {missing}", LIST_WIDTH)
    for plugin in registry.plugins:
        if plugin.listens:
            print(f"{plugin.distribution} ({plugin.name}) listens to events")
    for one in registry.uninstalled():
        offered = ", ".join(f"{kind} {name}" for kind, name in one.offers)
        print_wrapped(f"{offered}: not installed ({one.command})", LIST_WIDTH)
    for problem in registry.problems:
        note(f"memo: warning: {problem}")


@app.command()
def check(
    name: Annotated[str, typer.Argument(help="A backend's name, or kind/name where several kinds share it.")],
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write a page about a robot, with pictures.")
    ] = None,
    driven: Annotated[
        str, typer.Option("--robot", metavar="NAME", help="The arm that a robot driver is checked with: yours.")
    ] = "",
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before a device is moved.")] = False,
    json: Json = False,
) -> None:
    """Run the conformance suite of its kind on a backend. Exit code 0 when it passes every rule, else 1.

    Robots are also tested in the default simulator. Problems are listed first, one line per cause. A driver is checked
    with its default settings: what answers at that address moves.
    """
    from memo_core.plugins.registry import Registry
    from memo_core.testing.plugins import check_backend, find_backends

    registry = Registry()
    backends = find_backends(registry, name)
    robot = next((backend for backend in backends if backend.kind == "robot"), None)
    if html is not None and robot is None:
        raise InvalidArgument("--html", f"{name!r} is no robot", "a robot's name")
    if driven and not any(backend.kind == "robot_driver" for backend in backends):
        raise InvalidArgument("--robot", f"{name!r} is no robot driver", "robot_driver/NAME")
    arm = registry.get("robot", driven) if driven else None
    for backend in backends:
        _confirm_motion(backend, yes)
    trials: dict[str, RobotTrial] = {}
    results = [result for one in backends for result in check_backend(registry, one, trials=trials, arm=arm)]
    if html is not None and robot is not None:
        from memo_core.testing.robot_check.page import write_robot_page

        label = f"robot/{robot.name}"
        own = [result for result in results if result.backend == label]
        write_robot_page(html, robot.name, robot.summary, own, trials.get(label))
    broken = [result for result in results if result.outcome == "broken"]
    causes = [*broken, *(result for result in results if result.outcome == "limited")]
    if json:
        rules = [result.as_json() for result in results]
        told = [result.why for result in causes]
        print_json({"name": name, "conforms": not broken, "causes": told, "rules": rules})
    else:
        for result in causes:
            print(f"{result.backend} {result.outcome}: {result.why}")
        print_table(("backend", "rule", "outcome", "why"), [(r.backend, r.rule, r.outcome, r.why) for r in results])
    if broken:
        raise typer.Exit(1)


def _confirm_motion(backend: Backend, yes: bool) -> None:
    """Ask before the rules for a driver move what answers at its default address, unless that is this computer."""
    from memo_core.cli.robot_link import confirmed
    from memo_core.interfaces.driver import GripperDriver, RobotDriver

    if backend.kind not in ("robot_driver", "gripper_driver"):
        return
    try:
        driver = backend.factory(backend.config())
    except (MemoError, TypeError):
        return  # the rules say so
    address = driver.address if isinstance(driver, RobotDriver) else ""
    still = (
        driver.simulated if isinstance(driver, RobotDriver) else isinstance(driver, GripperDriver) and driver.included
    )
    if not still and not re.search(r"\b(localhost|127\.\d+\.\d+\.\d+)\b|\[?::1\b", address):
        where = f" ({address})" if address else ""
        confirmed(
            f"The rules connect to what answers at the default address of {backend.name}{where}, and move it.", yes
        )


def _missing(backend: Backend) -> str:
    import attrs

    from memo_core.plugins.registry import missing_needs

    needs = attrs.evolve(backend.needs, keys=backend.needs.secrets)
    return "; ".join(f"{missing.what}: {missing.remedy}" for missing in missing_needs(needs))


def _as_json(backend: Backend, distribution: str) -> dict[str, Any]:
    return {
        "kind": backend.kind,
        "name": backend.name,
        "summary": backend.summary,
        "distribution": distribution,
        "default": backend.default,
        "needs": {
            "modules": backend.needs.modules,
            "system": backend.needs.system,
            "environment": list(backend.needs.secrets),
        },
        "missing": _missing(backend) or None,
    }
