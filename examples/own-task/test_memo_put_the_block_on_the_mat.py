"""The rules that `memo plugins check suite/put-the-block-on-the-mat` checks, and what it does beyond them."""

import pytest
from memo_put_the_block_on_the_mat import memo_task_suites

from memo_core.testing.suite import RULES

[BACKEND] = memo_task_suites()


def make():
    return BACKEND.factory(BACKEND.config())


@pytest.mark.parametrize("rule", RULES)
def test_it_keeps_the_rule(rule):
    RULES[rule](make)
