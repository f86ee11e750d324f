"""What looks personal in free text is found, everyday remarks about the robot are not."""

from __future__ import annotations

import pytest

from memo_core.study.export import looks_personal


@pytest.mark.parametrize(
    "text",
    [
        "ask me at anna.smith@lab.org",
        "call me at 0721 608 12345",
        "my name is Anna, pull it",
        "my wife has the same microwave",
        "I'm 34 years old and saw it slip",
        "do it like Karlheinz did",
        "P07 said the same before",
    ],
)
def test_what_looks_personal_is_to_be_read(text):
    assert looks_personal(text, ids=("P07",))


@pytest.mark.parametrize(
    "text",
    [
        "no, pull the handle around in an arc",
        "You have to lift the locker's handle up before you pull the door.",
        "go 3 cm to the left. Then close your fingers",
        "don't press so hard on the plate, 15 N is enough",
    ],
)
def test_everyday_remarks_are_not(text):
    assert looks_personal(text, ids=("P07",)) == []
