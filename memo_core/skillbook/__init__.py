"""The skillbook: what people taught, kept under keys of action and objects."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.skillbook.book import Skillbook as Skillbook
    from memo_core.skillbook.explaining import Explanation as Explanation, explain as explain
    from memo_core.skillbook.model.entries import (
        Entry as Entry,
        Feedback as Feedback,
        Forgotten as Forgotten,
        Note as Note,
    )
    from memo_core.skillbook.model.keys import Key as Key
    from memo_core.skillbook.model.scene_context import SubtaskContext as SubtaskContext
    from memo_core.skillbook.retrieval.result import Retrieval as Retrieval, RetrievedEntry as RetrievedEntry
    from memo_core.skillbook.retrieval.settings import RetrievalSettings as RetrievalSettings
    from memo_core.skillbook.store.database import SkillbookError as SkillbookError

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
