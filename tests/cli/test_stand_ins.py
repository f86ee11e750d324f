"""Stand-ins hold while their block runs and no longer, also in modules that were imported first within it."""

from __future__ import annotations

import importlib
import sys

from memo_core import evaluation
from memo_core.runs import factories
from tests.support.stand_ins import stood_in

MODULE = "memo_core.evaluation.references"


def test_a_module_imported_first_within_the_block_binds_no_stand_in_afterwards(monkeypatch):
    monkeypatch.setattr(evaluation, "references", None, raising=False)  # what an import sets is undone with it
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    with stood_in():
        module = importlib.import_module(MODULE)
        assert module.environment_of is factories.environment_of
        stand_in = module.environment_of
    assert module.environment_of is factories.environment_of is not stand_in
    assert module.sandbox_of is factories.sandbox_of
