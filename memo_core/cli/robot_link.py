"""The connection to a real robot that commands outside of a run use, and the question they ask before it moves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from memo_core.cli.options import ConfigFile, Overrides, load
from memo_core.cli.output import note
from memo_core.cli.standard_input import agreed
from memo_core.errors import BackendUnavailable, InvalidArgument

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.interfaces.link import Link


def hardware(config: ConfigFile, overrides: Overrides) -> Experiment:
    """Raises ``BackendUnavailable`` if the experiment's robot is simulated."""
    _, experiment = load(config, overrides)
    if experiment.create("robot_driver").simulated:
        remedy = "robot.driver=… in the experiment, or --set"
        raise BackendUnavailable("robot_driver", "simulated", "it moves no real robot", remedy)
    return experiment


@contextmanager
def connected(experiment: Experiment) -> Iterator[Link]:
    """Connection to the experiment's robot, within the limits of ``hardware.safety``; the first signal stops the robot.

    Args:
        experiment: selects robot, driver and gripper driver; the driver must move hardware.

    Yields:
        The open link.

    Raises:
        BackendUnavailable: if another process moves the robot, it cannot be connected to, or
            ``GuardedLink.check_ready`` refuses it.
        InvalidArgument: if the driver cannot move this robot.
        RobotFault: if the robot does not accept commands.
    """
    from memo_core.arm.guarded_link import GuardedLink
    from memo_core.cli.signal_handling import handling
    from memo_core.environment.lease import Lease

    driver = experiment.create("robot_driver")
    robot = experiment.create("robot")
    lease = Lease(driver.address)
    with ExitStack() as stack:
        lease.take()
        stack.callback(lease.give_back)
        inner = driver.link(robot, experiment.create("gripper_driver"))
        link = GuardedLink(inner, robot, experiment.section("hardware").safety)
        stack.callback(link.close)
        link.open()
        link.check_ready(driver.address)
        with handling(lambda *_: link.stop()):
            yield link


def confirmed(what: str, yes: bool) -> None:
    """Announce a motion on stderr and ask a person to confirm it.

    Args:
        what: sentence that says what will move.
        yes: do not ask (``--yes``).

    Raises:
        InvalidArgument: if the answer is not yes, or standard input is closed or ends before an answer.
    """
    note(f"{what} A hand on the emergency stop, nobody within reach.")
    if yes:
        return
    if not agreed("Go on? [y/n]"):
        raise InvalidArgument("the answer", "not yes: nothing was done", "y, or --yes")
