"""``memo robot commission``: a guided hour with a real arm before its first task. Not a safety function."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli.options import ConfigFile, Overrides
from memo_core.cli.output import note
from memo_core.cli.robot_link import connected, hardware
from memo_core.cli.standard_input import agreed, answer_to
from memo_core.errors import InvalidArgument

Out = Annotated[Path, typer.Option("--out", help="File to write; `hardware.commissioning` names it in experiments.")]


class _AtTheTerminal:
    """The person who commissions, asked on standard error."""

    def tell(self, text: str) -> None:
        note(text)

    def ready(self, what: str) -> bool:
        return agreed(f"{what} [y: yes, s: leave it out]", "y or s")

    def answer(self, question: str) -> str:
        while not (said := answer_to(question)):
            pass
        return said


def command(config: ConfigFile = None, overrides: Overrides = None, out: Out = Path("commissioning.json")) -> None:
    """Establish, guided, what a real arm's runs rely on: which way it tells forces, what it feels at rest, that it
    reaches its workspace's corners, that its gripper holds. Writes a file that later runs are checked against."""
    import numpy as np

    from memo_core.environment import commissioning as steps

    experiment = hardware(config, overrides)
    if not out.parent.is_dir():
        raise InvalidArgument("--out", f"there is no folder {out.parent}", "a file in a folder that exists")
    person = _AtTheTerminal()
    limits, driver = experiment.section("hardware").safety, experiment.create("robot_driver")
    person.tell("Everybody outside the workspace, a hand on the emergency stop. Nothing here is a safety function.")
    by, arm = person.answer("Your name"), person.answer("The arm's serial number (on its base)")
    with connected(experiment) as link:
        bias, push = np.zeros(3), np.zeros(3)
        if link.feels_force:
            person.tell("Keep clear of the arm: what it feels at rest is measured for two seconds.")
            bias = steps.bias_of(link)
            person.tell(f"at rest {np.linalg.norm(bias):.1f} N are felt")
            if not person.ready("Push the resting hand steadily and gently (10 N) away from the base, along its x."):
                raise InvalidArgument("the answer", "no: the force's sign stays unknown", "y")
            push = steps.pushed(link, bias)
            shown = ", ".join(f"{one:.1f}" for one in push)
            if push[0] < 0:
                remedy = "reverse the driver's force sign (Franka: robot.force_sign) and commission it again"
                raise InvalidArgument("the force's sign", f"a push along x was felt as {shown} N", remedy)
            person.tell(f"the push was felt as {shown} N: the sign is right")
        corners = steps.visit_corners(link, limits, person)
        lifted = steps.lift_cube(link, person)
        robot = experiment.create("robot")
        found = steps.Commissioning(
            robot=robot.name,
            address=driver.address,
            arm=arm,
            by=by,
            at=datetime.now(UTC).isoformat(timespec="seconds"),
            tool=steps.tool_of(robot),
            stroke=robot.gripper.stroke,
            particulars=link.particulars(),
            bias=float(np.linalg.norm(bias)),
            push=[float(one) for one in push],
            corners=corners,
            lifted=lifted,
        )
    found.write(out)
    print(f"{out}: {len(corners)} corners reached, the gripper {'held' if lifted else 'did not hold'} a cube")
    note(f"later runs are checked against it with hardware.commissioning={out}")
