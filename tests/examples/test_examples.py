"""The scripts and the notebook in ``examples/`` run, and do what they say."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
URDF = EXAMPLES.parent / "memo_core" / "cli" / "skeletons" / "robot" / "example.urdf"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def taught(tmp_path_factory) -> tuple[Path, dict[str, bool]]:
    folder = tmp_path_factory.mktemp("taught")
    return folder, load("teach_and_watch").main(folder)


@pytest.mark.sim
def test_what_was_taught_on_one_task_helps_on_another(taught):
    folder, done = taught
    assert done == {"taught": True, "alone": True}
    [alone] = folder.glob("*put-the-food-in-the-microwave*")
    served = "".join(file.read_text(encoding="utf-8") for file in (alone / "retrieved").glob("*OPEN*microwave*"))
    assert "along an arc" in served


def test_a_book_can_be_looked_into(taught, capsys):
    folder, _ = taught
    served = load("look_into_a_book").main(str(folder / "lab.db"), "OPEN(oven)")
    assert any("arc" in text for text in served)
    assert "would be served" in capsys.readouterr().out


@pytest.mark.sim
def test_seeds_are_swept(tmp_path):
    assert load("sweep_over_seeds").main("stack-the-cubes", 2, tmp_path) == [True, True]


@pytest.mark.sim
def test_an_arm_is_read_from_its_urdf_and_moves(capsys):
    assert load("own_robot").main(URDF) < 0.003
    assert "guessed home" in capsys.readouterr().out


@pytest.mark.sim
def test_a_task_of_ones_own_can_be_done_and_not_by_doing_nothing():
    assert load("own_task").main(seed=1) == (False, True)


@pytest.mark.sim
def test_the_notebook_runs_from_top_to_bottom():
    cells = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))["cells"]
    namespace: dict = {"__name__": "__main__"}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for cell in cells:
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), cell["id"], "exec"), namespace)
    assert namespace["report"].success and "fridge handle" in printed.getvalue()


def test_each_script_is_run_by_a_test():
    tests = Path(__file__).parents[1]
    files = [Path(__file__), tests / "gym" / "test_gymnasium.py", tests / "plugins" / "test_third_simulator.py"]
    tested = "".join(file.read_text(encoding="utf-8") for file in files)
    assert [path.stem for path in EXAMPLES.glob("*.py") if path.stem not in tested] == []


@pytest.mark.sim
@pytest.mark.process
@pytest.mark.wire
def test_a_policy_made_of_demonstrations_beats_standing_still(tmp_path):
    played, still = load("policy_from_demonstrations").main("turn-on-the-faucet", 2, 2, tmp_path, first=2)
    assert sum(played) > sum(still) == 0
