"""Settings of the ``replay`` backend."""

from __future__ import annotations

from typing import Any, Literal

import attrs


@attrs.frozen
class ReplaySettings:
    """Settings of the ``replay`` backend (docs/language-models.md#recordings)."""

    file: str = attrs.field(
        validator=attrs.validators.min_len(1),
        metadata={"help": "the recording: JSON lines; one that ends in .gz is only played back"},
    )
    record: bool = attrs.field(
        default=False, metadata={"help": "true: ask `inner` and add each call to the file; false: play the file back"}
    )
    inner: Any = attrs.field(  # a Choice: made by the configuration, opened here
        default=None, metadata={"help": "the backend that is recorded", "backend": "llm"}
    )
    match: Literal["exact", "numbers", "situation"] = attrs.field(
        default="exact",
        metadata={
            "help": "numbers: a question that was not recorded may be answered by one that differs only in decimal "
            "numbers, by less than `tolerance`; situation: also by one asked in other words where task, subtask, "
            "what was done and what was taught are the same; each such answer says so"
        },
    )
    tolerance: float = attrs.field(
        default=0.02,
        validator=attrs.validators.ge(0.0),
        metadata={"help": "largest difference of two decimal numbers (metres, radians) that `match: numbers` accepts"},
    )

    def __attrs_post_init__(self) -> None:
        from memo_core.plugin import InvalidArgument

        if self.record and self.inner is None:
            raise InvalidArgument("inner", "nothing to record", "the backend to ask, e.g. `inner: {backend: …}`")
        if self.record and self.file.endswith(".gz"):
            raise InvalidArgument("file", f"{self.file}: a compressed recording cannot be added to", "a .jsonl file")
