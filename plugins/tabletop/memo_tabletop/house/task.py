"""Base class of the suite's tasks, and its robot code as text."""

from __future__ import annotations

from importlib import resources

from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.task import QuirkTask
from memo_tabletop.reference import solution

SORTING = "which crate takes what"
SEASONING = "how things are seasoned"
LOADING = "what goes on a tray first"
BRINGING = "what stands on the cork mat, and whose tray is which"

LESSONS = {
    SORTING: "Metal goes into the red crate, and plastic now goes into the blue crate, no longer into the green one.",
    SEASONING: "Give everything ten shakes, and never carry the shaker over the bread, go around it.",
    LOADING: "What is eaten goes on the tray first, dishes only after it.",
    BRINGING: "What stands on the cork mat is thin, hold it gently; Ana's tray is the blue one, Ben's the yellow one.",
}


class HouseTask(QuirkTask):
    """``trick`` names the ways of the house that a training task and its held-out tasks share; ``kind`` the abilities
    asked for."""


def house_code(*names: str, calls: str) -> str:
    """The functions for picking things up and putting them down, files of ``solutions/``, then the calls."""
    folder = resources.files("memo_tabletop.house.solutions")
    own = [folder.joinpath(f"{name}.py").read_text(encoding="utf-8") for name in names]
    return "\n\n".join([solution("handling", "boxes"), quirk_code("carry_gently"), *own, calls])
