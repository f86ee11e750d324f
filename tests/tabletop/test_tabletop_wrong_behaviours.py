"""Every task of both suites has wrong behaviours written out, of each kind, that physics and its check judge."""

from __future__ import annotations

from collections import Counter

import pytest
import test_force_tasks
import test_quirks_tasks
import test_tabletop_appliances
import test_tabletop_furniture
import test_tabletop_grains
import test_tabletop_things
from memo_tabletop.plugin import TabletopSettings, quirks, tasks

MODULES = (
    test_force_tasks,
    test_quirks_tasks,
    test_tabletop_appliances,
    test_tabletop_furniture,
    test_tabletop_grains,
    test_tabletop_things,
)
TASKS = (*tasks(TabletopSettings()), *quirks(TabletopSettings()))


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_each_task_has_three_wrong_behaviours_nearly_right_sloppy_and_cheating(task):
    [wrongs] = [table.WRONG[type(task)] for table in MODULES if type(task) in table.WRONG]
    assert set(Counter(wrong.how for wrong in wrongs)) == {"nearly right", "sloppy", "cheating"}
    assert len({(wrong.before, wrong.code) for wrong in wrongs}) == len(wrongs) >= 3


def test_there_are_all_of_them():
    assert len(TASKS) == 25 + 16 == sum(len(module.WRONG) for module in MODULES)
