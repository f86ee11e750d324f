"""Reading a run folder as a sequence of subtasks and attempts, for reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_core.policy.results import STATUS_IN_WORDS
from memo_core.runlog.event_log import read_events
from memo_core.runs.folder import attempt_name, file_name
from memo_core.text.parsing import parse_json


@attrs.define
class Try:
    """One attempt at a subtask; an attempt that was restarted counts again."""

    number: int
    take: int = 1
    codes: list[str] = attrs.field(factory=list)
    endings: list[str] = attrs.field(factory=list)
    printed: str = ""
    served: list[dict[str, Any]] = attrs.field(factory=list)
    cut: list[list[Any]] = attrs.field(factory=list)
    said: str = ""
    who: str = ""
    feedback: int | None = None
    learnt: list[dict[str, Any]] = attrs.field(factory=list)
    not_understood: list[str] = attrs.field(factory=list)
    stopped: bool = False
    robot_s: float = 0.0
    video: Path | None = None
    picture: Path | None = None


@attrs.define
class Act:
    """One subtask with its attempts."""

    subtask: str
    number: int
    status: str = ""
    tries: list[Try] = attrs.field(factory=list)
    planned: int = 1  # how often the subtask was planned so far

    @property
    def ending(self) -> str:
        """The status in words; empty if the run was cut off."""
        return STATUS_IN_WORDS.get(self.status, self.status)


@attrs.define
class Story:
    """One run."""

    folder: Path
    instruction: str = ""
    acts: list[Act] = attrs.field(factory=list)
    looks: list[tuple[Path, ...]] = attrs.field(factory=list)  # of each look, its pictures with boxes and names
    problems: list[str] = attrs.field(factory=list)
    struck: set[int] = attrs.field(factory=set)  # entries that were struck, or reworded, in this run
    summary: dict[str, Any] = attrs.field(factory=dict)


def read_story(folder: Path) -> Story:
    """The story of a run's folder, also of a killed run. Raises ``InvalidArgument`` if there is no run."""
    file = folder / "events.jsonl"
    if not file.exists():
        raise InvalidArgument("folder", f"{folder} holds no run", "a folder with events.jsonl")
    story = Story(folder)
    if (folder / "summary.json").exists():
        try:
            story.summary = parse_json((folder / "summary.json").read_text(encoding="utf-8", errors="replace"))
        except ValueError as error:
            story.problems.append(f"summary.json is damaged ({error})")
    for event in read_events(folder):
        try:
            _note(story, event)
        except (KeyError, TypeError) as error:
            story.problems.append(f"events.jsonl: a damaged {event['event']} is left out ({error!r})")
    looks: dict[str, list[Path]] = {}
    for picture in sorted((folder / "looks").glob("[0-9][0-9][0-9][0-9]-*.png")):
        looks.setdefault(picture.name[:4], []).append(picture)
    story.looks = [tuple(pictures) for pictures in looks.values()]
    for act in story.acts:
        for one in act.tries:
            name = f"{act.number:02d}-{file_name(act.subtask)}-{attempt_name(one.number, one.take)}"
            one.video = _if_there(folder / "video" / f"{name}.mp4")
            one.picture = _if_there(folder / "pictures" / f"{name}.png")
    return story


def _note(story: Story, event: dict[str, Any]) -> None:
    kind = event["event"]
    if kind == "RunStarted":
        story.instruction = event["instruction"]
    elif kind == "Problem":
        story.problems.append(f"{event['where']}: {event['message']}")
    elif kind == "SubtaskStarted":
        if not story.acts or story.acts[-1].number != event["number"]:
            planned = 1 + sum(act.subtask == event["subtask"] for act in story.acts)
            story.acts.append(Act(event["subtask"], event["number"], planned=planned))
        story.acts[-1].tries.append(Try(event["attempt"], event.get("take", 1)))
    elif kind == "SubtaskEnded" and story.acts:
        story.acts[-1].status = event["status"]
    elif kind == "EntryStruck":
        story.struck.add(event["entry"])
    elif kind == "EntryStored" and (taught := _try_of(story, event["feedback"])) is not None:
        taught.learnt.append(event)
    elif story.acts and story.acts[-1].tries:
        _note_try(story.acts[-1].tries[-1], kind, event)


def _try_of(story: Story, feedback: int | None) -> Try | None:
    """The attempt to which a remark refers."""
    tries = (one for act in story.acts for one in act.tries)
    return next((one for one in tries if feedback and one.feedback == feedback), None)


def _note_try(one: Try, kind: str, event: dict[str, Any]) -> None:
    if kind == "Retrieved":
        one.served, one.cut = event["served"], event["cut"]
    elif kind == "CodeWritten":
        one.codes.append(event["code"])
    elif kind == "CodeEnded":
        one.endings.append(event["error"] or "ran to its end")
        one.printed += event["printed"]
        one.stopped = one.stopped or event["stopped"]
        one.robot_s += event["sim_seconds"]
    elif kind == "FeedbackGiven":
        one.said, one.who, one.feedback = event["words"], event["who"], event["feedback"]
    elif kind == "EntryStored":
        one.learnt.append(event)
    elif kind == "ModelCalled":
        one.not_understood += event["not_understood"]


def _if_there(path: Path) -> Path | None:
    return path if path.exists() else None
