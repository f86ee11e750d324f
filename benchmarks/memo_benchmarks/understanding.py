"""What a language model makes of everyday sentences (``memo bench understanding FILE``).

For each sentence the model writes code for the subtask untaught (phase 2), unless the file holds the program whose
attempt the person saw; it notes what the person said of it (phase 3) and writes code again with those notes. A hand
without a robot runs both programs; what it does differently is compared with what the person meant, which the file says
as ``effects``:

- *understood*: all that was meant is in the second motion, and nothing that people talk about changed besides
- *asked back*: no note was made, and the answer says what would have to be asked
- *without effect*: noted, and the motion is the same
- *misread*: noted, and the motion changed in another way than was meant, or praise was noted as a correction

A sentence that is meant for the plan (another step ``first``, another ``object`` or ``place``) is understood where a
note about plans is made of it, as in a run.
Without ``effects`` a sentence that was noted is *to be judged*: by people, who see what the hand did differently, or
did already as it was noted.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import attrs
import yaml

from memo_benchmarks.effects import CHANGES, changed, met
from memo_benchmarks.recorded_hand import Motion, RecordedHand, motion_of
from memo_benchmarks.sayings_scenes import ROBOT, scene_for
from memo_core.errors import InvalidArgument
from memo_core.interfaces.llm import LanguageModel, Request
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers import Notes, Unreadable, read_code, read_notes
from memo_core.policy.prompting import messages
from memo_core.sandbox.sandbox import Sandbox
from memo_core.scene.graph import SceneGraph
from memo_core.skills.contract import documentation
from memo_core.skills.skill import Skill

ALREADY = {  # effects that the untaught motion may have already, and how a note says them
    "straight": r"straight|line",
    "lift straight": r"straight|line",
    "middle": r"middle|cent",
    "level": r"level|tilt|tip",
    "upright": r"upright|standing|level|tilt|tip",
    "no turn": r"turn|twist|rotat",
    "release": r"let (?:it )?go|let go|releas|open",
    "from": r"from (?:top|above|the front|front)",
    "open wider": r"open .*(?:wide|fully)",
    "close fingers first": r"close .* first",
}
_TOLD_ALREADY = {  # of these, what judges are told, as an effect and how a note says it
    "straight": r"\bstraight out\b|\bone line\b|\bstraight rows\b",
    "middle": r"\bmiddle\b",
    "level": r"\blevel\b",
    "from above": r"\bfrom (?:the )?(?:top|above)\b",
    "from front": r"\bfrom (?:the )?front\b",
    "open wider": r"\bopen .*\b(?:wider|fully)\b",
    "retreat up": r"\baway up\b|\bstraight up\b",
    "square": r"\bsides line up\b",
    "release": r"^let go of it\b",
    "part handle": r"\bby the handle\b|\bhold of the handle\b",
}

_PLANNED = frozenset(["first", "object", "other object", "not", "place", "beside"])  # effects that the plan decides
_OF_JUDGES = {"noted", "asked", "changed", "already", "judges", "verdict", "notes"}
Verdict = Literal["understood", "asked back", "without effect", "misread", "to be judged"]
PRAISE = re.compile(r"right|fine|good|well|approv|praise|worked|as it (?:is|was)", re.I)


@attrs.frozen
class Saying:
    """One sentence. ``effects`` are what should be different, in the words of ``memo_benchmarks.effects``."""

    task: str
    subtask: str
    seen: str  # what was visibly wrong
    says: str
    means: str = ""
    effects: tuple[str, ...] = attrs.field(converter=tuple, default=())
    code: str = ""  # the program of that attempt; without it the model writes one, which may do something else
    printed: str = ""
    ended: str = "a person found fault with it"

    @effects.validator
    def _known(self, _: Any, effects: tuple[str, ...]) -> None:
        for effect in effects:
            if not any(effect == name or effect.startswith(f"{name} ") for name in CHANGES):
                raise InvalidArgument("effects", f"{effect!r} in {self.says!r}", ", ".join(CHANGES))


@attrs.frozen
class Heard:
    """What became of a sentence."""

    saying: Saying
    verdict: Verdict
    notes: tuple[str, ...]
    asked: str
    changed: tuple[str, ...]  # what the hand did differently, in words
    already: tuple[str, ...] = ()  # what of the notes it did untaught; told only where nothing changed

    @property
    def told(self) -> dict[str, Any]:
        return attrs.asdict(self.saying) | {
            "verdict": self.verdict,
            "notes": list(self.notes),
            "asked": self.asked,
            "changed": list(self.changed),
            "already": list(self.already),
        }


@attrs.frozen
class _Note:
    """A note as the code prompt shows it."""

    text: str
    key: str


def sayings_in(path: Path) -> list[Saying]:
    """The sentences of a YAML or JSON Lines file, without verdicts. Raises ``InvalidArgument`` naming the entry."""
    found = []
    for i, row in enumerate(_rows(path), 1):
        row = {key: value for key, value in row.items() if key not in _OF_JUDGES} if isinstance(row, dict) else row
        try:
            found.append(Saying(**row))
        except TypeError as error:
            keys = ", ".join(field.name for field in attrs.fields(Saying))
            raise InvalidArgument("FILE", f"{path}: sentence {i}: {error}", keys) from None
    return found


def _rows(path: Path) -> list[Any]:
    try:
        text = path.read_text("utf-8")
        if path.suffix == ".jsonl":
            return [json.loads(line) for line in text.splitlines() if line.strip()]
        rows = yaml.safe_load(text)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise InvalidArgument("FILE", f"{path}: {error}", "a YAML list of sentences, or JSON Lines") from None
    return rows if isinstance(rows, list) else [rows]


def agreement(path: Path) -> dict[str, Any]:
    """What two judges said of each sentence of a JSON Lines file (``judges``: two verdicts): the share of each verdict
    by each of them, how often they agree, and Cohen's kappa. Raises ``InvalidArgument`` naming the entry."""
    pairs: list[tuple[str, str]] = []
    for i, row in enumerate(_rows(path), 1):
        said = row.get("judges") if isinstance(row, dict) else None
        if not (isinstance(said, list) and len(said) == 2 and all(isinstance(one, str) for one in said)):
            raise InvalidArgument("FILE", f"{path}: sentence {i} has no judges", '"judges": [VERDICT, VERDICT]')
        pairs.append((said[0], said[1]))
    if not pairs:
        raise InvalidArgument("FILE", f"{path} is empty", "a line a sentence")
    counts = [Counter(pair[judge] for pair in pairs) for judge in (0, 1)]
    observed = sum(a == b for a, b in pairs) / len(pairs)
    expected = sum(counts[0][verdict] * counts[1][verdict] for verdict in counts[0]) / len(pairs) ** 2
    shares_of = [{verdict: round(n / len(pairs), 3) for verdict, n in sorted(one.items())} for one in counts]
    kappa = 1.0 if expected == 1 else (observed - expected) / (1 - expected)
    return {
        "bench": "agreement",
        "sentences": len(pairs),
        "judge_a": shares_of[0],
        "judge_b": shares_of[1],
        "agreement": round(observed, 3),
        "kappa": round(kappa, 3),
    }


def bench_understanding(
    model: LanguageModel,
    sayings: list[Saying],
    skills: dict[str, Skill],
    prompts: Prompts,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Heard]:
    """Each sentence by itself, with an empty book. ``model`` is opened already."""
    heard = []
    with Sandbox(skills) as sandbox:
        listener = _Listener(model, skills, prompts, sandbox)
        for i, saying in enumerate(sayings, 1):
            heard.append(listener.hear(saying))
            progress(i / len(sayings))
    return heard


def shares(heard: list[Heard]) -> dict[str, Any]:
    """Counts and shares of each verdict."""
    counts = Counter(one.verdict for one in heard)
    report: dict[str, Any] = {"sentences": len(heard)}
    for verdict in ("understood", "asked back", "without effect", "misread", "to be judged"):
        if verdict == "to be judged" and not counts[verdict]:
            continue
        report[verdict.replace(" ", "_")] = counts[verdict]
        report[f"{verdict.replace(' ', '_')}_share"] = round(counts[verdict] / max(1, len(heard)), 3)
    return report


@attrs.frozen
class _Listener:
    model: LanguageModel
    skills: dict[str, Skill]
    prompts: Prompts
    sandbox: Sandbox

    def hear(self, saying: Saying) -> Heard:
        scene = scene_for(saying.subtask)
        code = saying.code or self._code(saying, scene, [])
        notes = self._notes(saying, scene, code)
        said = (*notes.corrections, *notes.general)
        before, after = self._motion(code, scene), None
        if said:
            after = self._motion(self._code(saying, scene, said), scene)
        told = changed(before, after) if before is not None and after is not None else {}
        already = _already(said, before, after, saying.subtask, scene) if said and not told else ()
        verdict = judged(saying, notes, before, after, scene)
        for_plans = tuple(f"for plans: {note}" for note in notes.plan)
        return Heard(saying, verdict, (*said, *for_plans), notes.unclear, tuple(told.values()), already)

    def _code(self, saying: Saying, scene: SceneGraph, notes: list[str] | tuple[str, ...]) -> str:
        corrections = [_Note(text, saying.subtask) for text in notes]
        return self._answer(
            "code",
            scene,
            read_code,
            task=saying.task.replace("-", " "),
            subtask=saying.subtask,
            done=[],
            skills=documentation(self.skills),
            subset="Python.",
            corrections=corrections,
            general=[],
            templates=[],
            attempts=[],
        )

    def _notes(self, saying: Saying, scene: SceneGraph, code: str) -> Notes:
        told = {"task": saying.task.replace("-", " "), "subtask": saying.subtask, "words": saying.says}
        attempt = {"code": code, "printed": saying.printed, "ended": saying.ended}
        try:
            return self._answer("feedback", scene, read_notes, plans=True, planning=False, **told, **attempt)
        except Unreadable as error:
            return Notes((), (), str(error))

    def _answer(self, phase: str, scene: SceneGraph, read: Callable[[str], Any], **context: Any) -> Any:
        asked = messages(phase, ROBOT, scene, self.prompts, **context)
        return read(self.model.answer(Request(phase, asked)).text)

    def _motion(self, code: str, scene: SceneGraph) -> Motion | None:
        hand = RecordedHand(scene)
        self.sandbox.run(code, hand, stopped=lambda: False)  # what ends in an error was moving up to there
        return motion_of(hand.commands)


def judged(saying: Saying, notes: Notes, before: Motion | None, after: Motion | None, scene: SceneGraph) -> Verdict:
    """The mechanical criterion, as the module's docstring says it."""
    said = (*notes.corrections, *notes.general)
    if notes.plan and (saying.effects or not said):
        for_plans = any(_name(effect) in _PLANNED for effect in saying.effects)
        return "understood" if for_plans else "misread" if saying.effects else "to be judged"
    if said and not saying.effects:
        return "to be judged"
    if not said:
        praised = "approve" in saying.effects and PRAISE.search(notes.unclear.partition(saying.says)[0])
        return "understood" if praised else "asked back"
    if {"approve", "ask"} & set(saying.effects):
        return "misread"
    if before is None or after is None:
        return "without effect"
    told = changed(before, after)
    allowed = set().union(*(CHANGES[_name(effect)] for effect in saying.effects))
    if set(told) - allowed:
        return "misread"
    fulfilled = [effect for effect in saying.effects if met(effect, before, after, saying.subtask, scene)]
    if told:
        return "understood" if fulfilled else "misread"
    # It is so already: then the note must at least say so.
    text = " ".join(said).lower()
    said_so = any(re.search(ALREADY.get(_name(effect), "(?!)"), text) for effect in fulfilled)
    return "understood" if said_so else "without effect"


def _already(
    said: tuple[str, ...], before: Motion | None, after: Motion | None, subtask: str, scene: SceneGraph
) -> tuple[str, ...]:
    """What of the notes the hand did before they were made."""
    if before is None or after is None:
        return ()
    text = " ".join(said).lower()
    noted = [effect for effect, words in _TOLD_ALREADY.items() if re.search(words, text)]
    return tuple(effect for effect in noted if met(effect, before, after, subtask, scene))


def _name(effect: str) -> str:
    return max((name for name in CHANGES if effect == name or effect.startswith(f"{name} ")), key=len)
