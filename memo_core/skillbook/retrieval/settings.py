"""Settings of retrieval: how much is retrieved, and by which score."""

from __future__ import annotations

from typing import Any, Literal

import attrs

from memo_core.config.layers import preset_sections
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook.model.action_relations import Actions, default_actions
from memo_core.skillbook.vectors.key_vectors import Wording

_TEMPLATES_RANKED = 20  # more than fit into any sensible number of characters
_EVERY_TEMPLATE = 1000  # where no number of characters limits them: more than there are candidates


def _positive(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not (isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < float("inf")):
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a number above 0")


def _share(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not 0 <= value <= 1:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a number, 0 to 1")


def _count(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1000:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a whole number, 0 to 1000")


def _characters(instance: object, attribute: attrs.Attribute[Any], value: int | None) -> None:
    if value is not None and (not isinstance(value, int) or isinstance(value, bool) or value < 0):
        expected = "a whole number of at least 0, or null for no limit"
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", expected)


def _cosine(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not -1 <= value <= 1:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a number, -1 to 1")


def _ranking(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    if value not in ("key", "key-and-text"):
        raise InvalidArgument("retrieval.ranking", f"{value!r} is not right", "'key' or 'key-and-text'")


@attrs.frozen
class RetrievalSettings:
    """The defaults were calibrated (``docs/skillbook.md``).

    r(q, v) = (λ1 cos(q_act, v_act) + λ2 cos(q_obj, v_obj)) / (λ1 + λ2) compares keys. With ``ranking: key`` it decides
    alone, as in the paper. With ``key-and-text`` the score of an entry e under key v is

        s(q, e) = (1 - w_t - w_o) r(q, v)
                  + (1 - x(q, v)) (w_t (cos(q, e) + cos(q, v)) / 2 + w_o overlap(q, e)) + w_b (b(q, e) - 0.5)

    where the cosines are those of the plain words of subtask, text and key, the overlap is the share of the subtask's
    terms that the text has (``memo_core.skillbook.retrieval.shared_terms``), and x, 0 to 1, says how far the objects of
    q and v agree in exchanged roles only: words do not tell roles. b, 0 to 1, says how alike the things are built that
    the two are about (``memo_core.scene.structure``). Where the scene of one entry is not known, b is the mean of the
    others'; where none is, that term is left out. It counts for the best few dozen of each kind only."""

    lambda_action: float = attrs.field(
        default=0.75,
        validator=_positive,
        metadata={"help": "λ1, weight of actions", "paper": "Sec. IV-B: λ1 > 0; the value is its authors'"},
    )
    lambda_objects: float = attrs.field(
        default=0.25,
        validator=_positive,
        metadata={"help": "λ2, weight of objects", "paper": "Sec. IV-B: λ2 > 0; the value is its authors'"},
    )
    cut: float = attrs.field(
        default=0.85,
        validator=_cosine,
        metadata={
            "help": "keys with a smaller r are not retrieved (key), or only by what their entries say (key-and-text)",
            "paper": "no value in the paper; this one is its authors'",
        },
    )
    ranking: Literal["key", "key-and-text"] = attrs.field(
        default="key-and-text",
        validator=_ranking,
        metadata={
            "help": "key: by r(q, v) alone, as in the paper; key-and-text: also by what an entry says",
            "paper": "Sec. IV-B: r(q, v) alone",
        },
    )
    text_weight: float = attrs.field(
        default=0.245,
        validator=_share,
        metadata={"help": "w_t, weight of the likeness of texts", "paper": "no effect with ranking: key"},
    )
    overlap_weight: float = attrs.field(
        default=0.105,
        validator=_share,
        metadata={
            "help": "w_o, weight of the terms that subtask and text share",
            "paper": "no effect with ranking: key",
        },
    )
    built_weight: float = attrs.field(
        default=0.3,
        validator=_share,
        metadata={
            "help": "w_b, weight of how alike the things seen are built to those an entry was said of",
            "paper": "no effect with ranking: key",
        },
    )
    reach: float = attrs.field(
        default=0.17,
        validator=_share,
        metadata={
            "help": "below the cut, entries are retrieved whose s is so near the best",
            "paper": "no effect with ranking: key",
        },
    )
    text_floor: float = attrs.field(
        default=0.35,
        validator=_cosine,
        metadata={
            "help": "below the cut, a text that shares no term with the subtask must be this like it",
            "paper": "no effect with ranking: key",
        },
    )
    fill: int = attrs.field(
        default=14,
        validator=_count,
        metadata={
            "help": "entries below the cut are retrieved as long as there are not so many in all",
            "paper": "no effect with ranking: key",
        },
    )
    newest: bool = attrs.field(
        default=True,
        metadata={
            "help": "always retrieve what each person said last under the subtask's own key, before their older notes",
            "paper": "Sec. IV-B: r(q, v) alone",
        },
    )
    notice_harm: bool = attrs.field(
        default=True,
        metadata={
            "help": "withhold what was corrected when it was retrieved for a like subtask of another key",
            "paper": "Sec. IV-B: r(q, v) alone",
        },
    )
    corrections: int = attrs.field(
        default=20,
        validator=_count,
        metadata={
            "help": "most notes of corrections shown in a prompt (top-k)",
            "paper": "Sec. IV-B: no limit; 1000 is the most that can be set",
        },
    )
    general: int = attrs.field(
        default=10,
        validator=_count,
        metadata={
            "help": "most notes of general statements shown in a prompt (top-k)",
            "paper": "Sec. IV-A: all general statements share one key; 1000 is the most that can be set",
        },
    )
    general_floor: float = attrs.field(
        default=0.2,
        validator=_cosine,
        metadata={
            "help": "general statements less like the subtask are not retrieved",
            "paper": "Sec. IV-A: all general statements share one key",
        },
    )
    templates: int = attrs.field(
        default=3,
        validator=_count,
        metadata={
            "help": "templates below the cut are retrieved while there are not so many in all; 0: no templates",
            "paper": "Sec. IV-B: no limit; all above the cut are retrieved, and with ranking: key none below it",
        },
    )
    template_reach: float = attrs.field(
        default=0.15,
        validator=_share,
        metadata={
            "help": "templates are retrieved whose score is so near the best one's",
            "paper": "Sec. IV-B: no limit",
        },
    )
    template_characters: int | None = attrs.field(
        default=6000,
        validator=_characters,
        metadata={
            "help": "characters of all templates retrieved; the best is retrieved whole even if longer; null: no limit",
            "paper": "Sec. IV-B: no limit",
        },
    )
    fold_templates: bool = attrs.field(
        default=True,
        metadata={
            "help": "of templates that differ only in names, docstring and constants retrieve only the best",
            "paper": "Sec. IV-B: no limit",
        },
    )
    action_phrase: str = attrs.field(
        default=Wording().action,
        metadata={"help": "phrase for actions, one {}", "paper": "Sec. IV-A: the action itself is embedded"},
    )
    object_phrase: str = attrs.field(
        default=Wording().object,
        metadata={"help": "phrase for objects, one {}", "paper": "Sec. IV-A: the objects themselves are embedded"},
    )
    shipped_actions: bool = attrs.field(
        default=True,
        metadata={
            "help": "begin with MEMO's own tables of synonyms and opposites; false: with none",
            "paper": "Sec. IV-B: synonyms by their embeddings",
        },
    )
    synonyms: dict[str, list[str]] = attrs.field(
        factory=dict,
        metadata={"help": "more synonym groups of actions", "paper": "Sec. IV-B: synonyms by their embeddings"},
    )
    opposites: list[list[str]] = attrs.field(
        factory=list, metadata={"help": "more pairs of opposite actions", "paper": "Sec. IV-B: r(q, v) alone"}
    )

    def __attrs_post_init__(self) -> None:
        if self.text_weight + self.overlap_weight > 1:
            problem = f"with overlap_weight {self.overlap_weight:g} it is more than 1"
            raise InvalidArgument("retrieval.text_weight", problem, "a sum of at most 1; the rest weighs the key")

    @classmethod
    def preset(cls, name: str) -> RetrievalSettings:
        """Settings of a retrieval preset.

        Args:
            name: name of the preset, such as ``paper`` in ``retrieval: paper``.

        Returns:
            The settings; defaults for what the preset leaves out.

        Raises:
            UnknownName: if there is no such preset.
        """
        known = preset_sections("retrieval")
        if name not in known:
            raise UnknownName("retrieval preset", name, tuple(known))
        return cls(**known[name])

    def limit(self, kind: str) -> int:
        """Largest number of entries ranked of a kind (``correction``, ``template`` or ``general``); of templates, fewer
        may be retrieved (``select_templates``)."""
        templates = _TEMPLATES_RANKED if self.template_characters is not None else _EVERY_TEMPLATE
        return {
            "correction": self.corrections,
            "template": templates if self.templates else 0,
            "general": self.general,
        }[kind]

    def room(self, kind: str) -> int:
        """Number of entries of a kind, as in ``limit``, up to which entries below the cut are retrieved."""
        return min(self.fill, self.templates if kind == "template" else self.limit(kind))

    @property
    def weights(self) -> tuple[float, float]:
        return (float(self.lambda_action), float(self.lambda_objects))

    @property
    def wording(self) -> Wording:
        return Wording(self.action_phrase, self.object_phrase)

    @property
    def actions(self) -> Actions:
        shipped = default_actions() if self.shipped_actions else Actions({}, frozenset())
        if not self.synonyms and not self.opposites:
            return shipped
        return shipped.extended(self.synonyms, self.opposites)
