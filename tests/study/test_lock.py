"""Two processes do not teach or evaluate in one folder."""

from __future__ import annotations

import pytest

from memo_core.errors import InvalidArgument
from memo_core.study.lock import working_in


def test_a_second_one_is_refused_until_the_first_has_ended(tmp_path):
    again = working_in(tmp_path / "x")
    with working_in(tmp_path / "x"), pytest.raises(InvalidArgument, match="another process is at work"), again:
        pass
    with working_in(tmp_path / "x"):
        pass
