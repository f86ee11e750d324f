"""``memo robot``: check a real robot, move it slowly by command, and clear its errors. Not a safety function."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import attrs
import numpy as np
import typer

from memo_core.cli.commission import command as commission
from memo_core.cli.options import ConfigFile, Json, Overrides
from memo_core.cli.output import print_json, print_table
from memo_core.cli.robot_link import confirmed, connected, hardware
from memo_core.errors import InvalidArgument

if TYPE_CHECKING:
    from memo_core.interfaces.link import Link

app = typer.Typer()
app.command("commission")(commission)

Yes = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask first.")]


@app.command()
def check(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Check the computer, the robot and its cameras, and say what prevents it from moving. Nothing moves. Exit code 1
    if anything does."""
    from memo_core.environment.hardware_check import examine_host, examine_robot

    experiment = hardware(config, overrides)
    driver, gripper, robot = (experiment.create(kind) for kind in ("robot_driver", "gripper_driver", "robot"))
    settings = experiment.section("hardware")
    looking = functools.partial(experiment.create, "perception")
    found = [*examine_host(), *examine_robot(driver, gripper, robot, settings, looking)]
    if json:
        print_json({"checks": [attrs.asdict(one) for one in found]})
    else:
        print_table(("what", "state", "detail", "remedy"), [attrs.astuple(one) for one in found])
    if any(one.state == "failed" for one in found):
        raise typer.Exit(1)


@app.command()
def home(config: ConfigFile = None, overrides: Overrides = None, yes: Yes = False) -> None:
    """Move slowly to the home configuration, in a straight line in joint space. No perception is used: keep the path
    free."""
    with connected(hardware(config, overrides)) as link:
        confirmed("The arm moves to its home posture, straight through its joints and past no obstacle.", yes)
        _move(link, lambda: np.array(link.description.home))


@app.command()
def jog(
    joint: Annotated[int, typer.Argument(min=1, help="Which joint; 1 is the base's.")],
    amount: Annotated[
        float, typer.Argument(help="How far: degrees, or cm if the joint slides; -- before a negative number.")
    ],
    config: ConfigFile = None,
    overrides: Overrides = None,
    yes: Yes = False,
) -> None:
    """Move one joint slowly. No perception is used: keep the path free."""
    experiment = hardware(config, overrides)
    units = experiment.create("robot").position_units
    if joint > len(units):
        raise InvalidArgument("JOINT", f"{joint}", f"1 to {len(units)}")
    slides = units[joint - 1] == "m"
    most, unit = (20, "cm") if slides else (90, "degrees")
    if not abs(amount) <= most:
        raise InvalidArgument("AMOUNT", f"{amount:g}", f"-{most} to {most} {unit}")
    step = amount / 100 if slides else math.radians(amount)
    with connected(experiment) as link:
        confirmed(f"Joint {joint} {'slides' if slides else 'turns'} by {amount:g} {unit}.", yes)
        _move(link, lambda: link.joint_targets() + step * np.eye(len(units))[joint - 1])


@app.command()
def recover(config: ConfigFile = None, overrides: Overrides = None, yes: Yes = False) -> None:
    """Clear an error of the robot, such as a reflex, after a person has inspected it. Nothing moves."""
    from memo_core.environment.lease import Lease

    experiment = hardware(config, overrides)
    driver = experiment.create("robot_driver")
    lease = Lease(driver.address)
    lease.take()
    try:
        link = driver.link(experiment.create("robot"), experiment.create("gripper_driver"))
        confirmed("Have you seen why it stopped, and is the arm free?", yes)
        try:
            link.recover()
        finally:
            link.close()
    finally:
        lease.give_back()
    print("the robot can be commanded")


def _move(link: Link, goal: Callable[[], np.ndarray]) -> None:
    from memo_core.arm.home_and_gains import in_units
    from memo_core.arm.settling import check_arrived
    from memo_core.arm.slow_motion import move_joints

    move_joints(link, goal())
    check_arrived(link)
    shown = [f"{position:.3f}" for position in np.round(link.joint_positions(), 3) + 0.0]
    print(f"at rest; joints {in_units(shown, link.description.position_units)}")
