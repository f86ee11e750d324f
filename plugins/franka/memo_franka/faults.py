"""The faults of a Franka arm, each described in one sentence with its remedy."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import RobotFault

_RECOVER = "look what happened, then memo robot recover"
_COLLISIONS = ("cartesian reflex", "joint reflex")
_FAULTS = {
    "reflex": ("it ended the motion by a reflex: {detail}", _RECOVER),
    "user-stop": ("the user stop is pressed", "release the external activation device, then memo robot recover"),
    "brakes": ("its brakes are shut", "open them in Desk (Unlock joints)"),
    "guiding": ("somebody guides it by hand", "let go of the guiding buttons"),
    "version": ("{detail}", "install the client library of the version that the robot speaks"),
    "fci-off": ("it refuses connections at {detail}", "activate FCI in Desk, and check that nobody else is connected"),
    "unreachable": ("{detail} does not answer", "check the cable, the address, and that the control box is on"),
    "network": ("the connection was lost: {detail}", "check the cable and the control box, then start again"),
    "clock": ("its clock has stood still for {detail}", "check the network; the control box may have to be restarted"),
    "ended": ("its controller ended: {detail}", _RECOVER),
    "gripper": ("its gripper has a fault: {detail}", "see to the gripper, then start again"),
    "outside": ("it is outside its joint limits: {detail}", "guide it back by hand in Desk's programming mode"),
}


def fault(robot: str, name: str, detail: str = "") -> RobotFault:
    """The fault of that name, about the robot at an address."""
    problem, remedy = _FAULTS[name]
    return RobotFault(robot, name, problem.format(detail=detail), remedy)


def fault_of_state(robot: str, state: Any, gives_way: str = "") -> RobotFault | None:
    """The fault shown by a state of franky; None if the robot accepts commands. ``gives_way``: setting that makes a
    stiff arm give way to contact, told where it collided."""
    mode = state.robot_mode.name
    if mode in ("Idle", "Move"):
        return None
    if mode == "Reflex":
        told = fault(robot, "reflex", errors_of(state))
        if gives_way and any(name in told.problem for name in _COLLISIONS):
            told.remedy += f"; {gives_way} makes a stiff arm give way to doors and other contact"
        return told
    names = {"UserStopped": "user-stop", "Guiding": "guiding", "Other": "brakes"}
    return fault(robot, names[mode]) if mode in names else fault(robot, "ended", "it recovers from an error")


def fault_of_error(robot: str, error: Exception) -> RobotFault:
    """The fault behind an exception of franky if no state gives more detail."""
    name, text = type(error).__name__, " ".join(str(error).split()).removeprefix("libfranka: ")
    if name == "IncompatibleVersionException":
        return fault(robot, "version", version_problem(text))
    if "refused" in text:
        return fault(robot, "fci-off", robot)
    if "timeout" in text.lower() and "Connection" in text:
        return fault(robot, "unreachable", robot)
    if name == "NetworkException" or "UDP" in text or "TCP" in text or "connection" in text:
        return fault(robot, "network", text)
    if "User Stop" in text:
        return fault(robot, "user-stop")
    if "reflex" in text:
        return fault(robot, "reflex", text)
    return fault(robot, "ended", text)


def version_problem(text: str) -> str:
    """Which arm uses which interface version, and where to get a library for it."""
    return (
        f"its server has another version than this library ({text}); PyPI's franky-control speaks version 10 (FR3, "
        "system 5.9 and later), a Panda speaks version 5: franky's own index (its README) has a build for each"
    )


def errors_of(state: Any) -> str:
    """Names of the errors of a state, present or of the last motion."""
    for errors in (state.current_errors, state.last_motion_errors):
        names = [name for name in dir(errors) if not name.startswith("_") and getattr(errors, name) is True]
        if names:
            return ", ".join(name.replace("_", " ") for name in names)
    return "no error is named"
