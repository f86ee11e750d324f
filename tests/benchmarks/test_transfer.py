"""A lesson taught in one simulator is of use in the other, and the table of it goes on where it was cut off."""

from __future__ import annotations

from pathlib import Path

import attrs
import pytest
from memo_benchmarks.transfer import NOBODY, Row, Transfer

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS

SIMULATORS = ("mujoco", "pybullet")
DONE = {("mujoco", "mujoco"), ("pybullet", NOBODY), ("pybullet", "mujoco")}
QUICK = ("run.video=off", "run.repairs=0", "run.repeats=1", "run.subtasks=1")


def transfer_in(
    folder: Path, tried: tuple[str, ...] = ("put-the-food-in-the-oven",), settings: tuple[str, ...] = QUICK
):
    registry = Registry()
    experiments = {
        name: load_experiment(registry, None, (*settings, f"simulator.backend={name}"), SECTIONS) for name in SIMULATORS
    }
    return Transfer(experiments, registry, folder, (0,), (), tried)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("transfer")


@pytest.fixture(scope="module")
def trials(folder):
    return list(transfer_in(folder).trials())


@pytest.mark.sim
def test_what_was_taught_in_one_simulator_is_of_use_in_the_other(folder, trials):
    """One subtask a run, the opening of a door: the whole of the table takes minutes."""
    assert len(trials) == transfer_in(folder).size == 8
    for lesson in (trial for trial in trials if trial.lesson):
        assert lesson.first and lesson.corrections > 0, f"{lesson.simulator}: {lesson.why}"
    for trial in (trial for trial in trials if not trial.lesson):
        what = f"{trial.task} in {trial.simulator} with the book of {trial.taught_in or 'nobody'}: {trial.why}"
        assert trial.first == (trial.taught_in != NOBODY), what


def test_the_table_counts_the_trials_of_each_book(folder, trials):
    transfer = transfer_in(folder)
    for trial in trials:
        transfer._log.done[trial.key] = attrs.evolve(trial, success=(trial.simulator, trial.taught_in) in DONE)
    assert transfer.table() == [
        Row("put-the-food-in-the-oven", "mujoco", 1, 0, 1, {"pybullet": 0}),
        Row("put-the-food-in-the-oven", "pybullet", 1, 1, 0, {"mujoco": 1}),
    ]
    del transfer._log.done[trials[-1].key]
    assert [row.seeds for row in transfer.table()] == [1, 0], "a row of which something is missing counts"


def test_what_is_done_is_not_done_again(folder, trials):
    before = sorted(folder.iterdir())
    assert {trial.key for trial in transfer_in(folder).trials()} == {trial.key for trial in trials}
    assert sorted(folder.iterdir()) == before, "a run was made"


@pytest.mark.sim
def test_after_a_kill_only_what_is_missing_is_done(folder, trials):
    file = folder / "trials.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    lost = trials[-1]
    assert f'"task": "{lost.task}"' in lines[-1]
    file.write_text("".join(lines[:-1]) + lines[-1][:40])
    again = transfer_in(folder)
    [*known, done] = again.trials()
    assert len(known) == len(trials) - 1 and known == [trial for trial in trials if trial.key != lost.key]
    assert done.key == lost.key and done.success == lost.success and done.folder != lost.folder
    assert again.table() == transfer_in(folder).table()


def test_a_folder_of_another_experiment_is_refused(folder, trials):
    with pytest.raises(InvalidArgument, match=r"of another experiment \(it differs in mujoco, pybullet\)"):
        transfer_in(folder, settings=(*QUICK, "run.attempts=1"))


def test_what_cannot_be_compared_is_refused_before_anything_is_taught(tmp_path):
    registry = Registry()
    one = {"mujoco": load_experiment(registry, None, QUICK, SECTIONS)}
    with pytest.raises(InvalidArgument, match="two or more"):
        Transfer(one, registry, tmp_path / "one", (0,))
    with pytest.raises(InvalidArgument, match="put-the-food-in-the-microwave is taught, too"):
        transfer_in(tmp_path / "both", tried=("put-the-food-in-the-microwave",))
    with pytest.raises(UnknownName, match="put-the-food-in-the-oven"):
        transfer_in(tmp_path / "typo", tried=("put-the-food-in-the-ovne",))
    assert not list(tmp_path.iterdir()), "a folder was made"


@pytest.mark.sim
def test_without_its_lesson_nothing_is_tried(tmp_path, monkeypatch):
    """A lesson that a language model's failure broke off is left for next time, and what needs its book as well."""
    transfer = transfer_in(tmp_path)
    performed = []
    real = Transfer._perform

    def perform(self, seed, task, simulator, taught_in, lesson):
        performed.append((simulator, taught_in, lesson))
        if lesson and simulator == "mujoco":
            return real(self, seed, task, simulator, taught_in, lesson)
        return Broken(), None

    class Broken:
        ended_by_person, outcome, resumable, success = False, None, True, False

    monkeypatch.setattr(Transfer, "_perform", perform)
    assert [trial.key for trial in transfer.trials()] == [
        (0, "put-the-food-in-the-microwave", "mujoco", "mujoco", True)
    ]
    assert ("mujoco", "pybullet", False) not in performed and ("pybullet", "pybullet", False) not in performed
    assert ("mujoco", "mujoco", False) in performed and ("mujoco", NOBODY, False) in performed
