"""MEMO and the baseline methods: the kinds of entries that each stores and retrieves."""

from __future__ import annotations

import attrs


@attrs.frozen
class Memory:
    """The kinds of entries that a language method makes and retrieves. Feedback is always stored."""

    summary: str = ""
    corrections: bool = True
    general: bool = True
    templates: bool = True
    clusters: bool = True  # condensed offline (memo cluster)

    @property
    def any(self) -> bool:
        return self.corrections or self.general or self.templates


METHODS = {
    "memo": Memory("corrections, general statements and templates"),
    "memo-c": Memory("memo without clustering", clusters=False),
    "memo-s": Memory(
        "no skillbook: what is said helps the next try only",
        corrections=False,
        general=False,
        templates=False,
        clusters=False,
    ),
    "droc-v": Memory("specific corrections only", general=False, templates=False, clusters=False),
}
