"""Selection of the ranked templates that are retrieved. A template is long, and one of little likeness misleads, so
neither a number of them nor their order alone decides."""

from __future__ import annotations

import attrs

from memo_core.skillbook.model.code_shape import code_shape
from memo_core.skillbook.retrieval.result import Cut, Retrieval, RetrievedEntry
from memo_core.skillbook.retrieval.score import TIE
from memo_core.skillbook.retrieval.settings import RetrievalSettings


def select_templates(found: Retrieval, settings: RetrievalSettings) -> Retrieval:
    """``found`` with the best template and, in order, those others whose score is near its score, whose code is not
    that of a better one (``code_shape``) and that fit what is left of ``template_characters``."""
    selected: list[RetrievedEntry] = []
    cut: list[Cut] = []
    for one in found.templates:
        rule = _rule_against(one, selected, settings)
        if rule:
            cut.append(Cut(one.key, one.key_score, rule, one.action_cosine, one.objects_cosine, 1))
        else:
            selected.append(attrs.evolve(one, rank=len(selected) + 1))
    return attrs.evolve(found, templates=tuple(selected), cut=(*cut, *found.cut))


def _rule_against(one: RetrievedEntry, better: list[RetrievedEntry], settings: RetrievalSettings) -> str:
    """The rule that excludes a template after some better ones; "" for none."""
    if not better:
        return ""
    if one.score < better[0].score - settings.template_reach - TIE:
        return f"more than {settings.template_reach:g} below the best template"
    if settings.fold_templates:
        shape = code_shape(one.text)
        same = next((other for other in better if code_shape(other.text) == shape), None)
        if same is not None:
            return f"the same code as template {same.entry.id}"
    most = settings.template_characters
    if most is not None and sum(len(other.text) for other in (*better, one)) > most:
        return f"beyond {most} characters of templates"
    return ""
