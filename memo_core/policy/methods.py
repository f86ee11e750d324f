"""MEMO and the baseline methods: the kinds of entries that each stores and retrieves. Feedback is always stored."""

from __future__ import annotations

from memo_core.interfaces.backend import NO_MEMORY, Memory

METHODS = {
    "memo": Memory(),
    "memo-c": Memory(clusters=False),
    "memo-s": NO_MEMORY,
    "droc-v": Memory(general=False, templates=False, clusters=False),
}
