"""Every effect of a run on its environment and every input from it, one method each, recorded in the run's log.

Between effects the loop only computes, so that it can be run again with the effects answered from the log
(``memo_core.runlog``). A new effect is a kind (one line) and a method that calls ``RunLog.effect``.
"""

from __future__ import annotations

import base64
import json
import time
import zlib
from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol

import attrs

from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, Sighting, TaskEpisode, Verdict
from memo_core.policy.pictures import Picture, PictureFiles, taken
from memo_core.policy.run_context import Session
from memo_core.process.stop_switch import Leaving
from memo_core.runlog.run_log import Effect, LogMismatch
from memo_core.runlog.words_file import WordsFile
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.graph import SceneGraph
from memo_core.scene.graph_json import pack_scenes, scene_of, scene_record, unpack_scenes
from memo_core.text.parsing import read_as


@attrs.frozen(eq=False)
class Executed:
    """How code ended, and how long it took on the robot's clock and in wall-clock time (s)."""

    execution: Execution
    took_s: float
    wall_s: float = 0.0

    @property
    def moved(self) -> bool:
        return self.took_s > 0

    @property
    def stopped(self) -> bool:
        return self.execution.ended == "stopped"


@attrs.frozen
class Heard:
    """A verdict. ``feedback``: the id of the words in the book; 0 if they are not stored there."""

    kind: Literal["approve", "correct", "silent"]
    words: str = ""
    feedback: int = 0

    @property
    def stays(self) -> bool:
        """Whether the world stays as the attempt left it, because the attempt was not corrected."""
        return self.kind != "correct"


@attrs.frozen
class Answered:
    """A reaction to a read-back. ``feedback``: the id of the words of a rewording; 0 if there are none."""

    answer: ReadBack
    feedback: int = 0


class WordStore(Protocol):
    """The single place where the words of one verdict are stored; the run's log refers to them by their number."""

    def keep(self, words: str, entry: int, state: str) -> int:
        """Store words that are the result of this log entry, together with the teacher's state after them, in one
        transaction. On disk when this returns. Returns their number."""

    def kept(self, entry: int) -> tuple[int, str, str] | None:
        """Number, words and state stored for the entry, if any."""

    def read(self, number: int) -> str:
        """The words. Raises ``InvalidArgument`` if they were removed."""


class Effects:
    """The environment and the teacher, as the loop uses them."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._person = session.person
        self._environment = session.environment
        self._log = session.log
        self._leaving = Leaving(session.stop)
        self._time = 0.0  # s, on the robot's clock, after the last effect
        self._world = b""  # the newest checkpoint
        self._looks: list[dict[str, Any]] = []  # since it was taken
        self._seen: list[Sighting] | None = None  # since somebody began to watch
        self._praise: WordStore = WordsFile(session.log.folder, session.person.who)  # words that are no correction
        self._teacher = ""  # what the teacher needs to go on, after the last verdict
        self._files = PictureFiles(session.log.folder)
        self.pictures: tuple[Picture, ...] = ()  # of the last look, if prompts are to have them
        self.scene: SceneGraph = session.environment.control.scene()  # as the robot saw it last
        if self.exact:
            self._log.world_known = True  # it is put back
        self._log.before_live(self._catch_up)

    @property
    def exact(self) -> bool:
        """Whether the world can be restored exactly."""
        return self._environment.link.can_restore

    @property
    def time(self) -> float:
        """Seconds on the robot's clock."""
        return self._time

    def catch_up(self) -> None:
        """Bring the world to the state in which the run left it, even if every effect was answered from the log."""
        self._log.go_live()

    def close(self) -> None:
        """Wait for abandoned work, since nothing may use the world while it is being closed."""
        self._leaving.wait()

    # -- seeing --------------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """The world as the run finds it."""
        kind: Effect[SceneGraph] = Effect("start", self._keep_scene, self._read_scene)
        self.scene = self._log.effect(kind, self._environment.instruction, lambda _: self._environment.control.scene())

    def look(self) -> SceneGraph:
        """Take a new look with the robot's perception. Skills use its result from now on."""
        kind: Effect[SceneGraph] = Effect("look", self._keep_look, self._read_look, world=True)
        self.scene = self._log.effect(kind, "", lambda _: self._look())
        return self.scene

    def _look(self) -> SceneGraph:
        scene = self._environment.look()
        if self._session.images:
            self.pictures = taken(self._environment.pictures(scene))
            if not self.pictures:
                given = "this perception has no pictures"
                raise InvalidArgument(
                    "policy.images", given, "perception.backend=cameras, or perception.images=[CAMERA]"
                )
        return scene

    def glance(self) -> SceneGraph:
        """What a person in the room sees now, or saw last while the robot is still stopping."""
        kind: Effect[SceneGraph] = Effect("glance", scene_record, scene_of)
        return self._log.effect(
            kind, "", lambda _: self._last_seen() if self._leaving.busy else self._environment.glance()
        )

    def _last_seen(self) -> SceneGraph:
        seen = self._environment.sightings()
        return seen[-1].scene if seen else self.scene

    def start_watching(self) -> None:
        kind: Effect[None] = Effect("start watching", lambda _: self._keep_seen(), self._read_start)
        self._seen = []
        self._log.effect(kind, "", lambda _: self._environment.start_watching())

    def stop_watching(self) -> tuple[Sighting, ...]:
        """What a person saw since ``start_watching``."""
        kind: Effect[tuple[Sighting, ...]] = Effect("stop watching", self._keep_seen, self._read_seen)
        seen = self._log.effect(kind, "", lambda _: self._stop_watching())
        self._seen = None
        return seen

    def _stop_watching(self) -> tuple[Sighting, ...]:
        """Nothing is observed while another thread still moves the robot, because a simulator allows one user at a
        time."""
        return self._environment.sightings() if self._leaving.busy else self._environment.stop_watching()

    # -- acting --------------------------------------------------------------------------------------------------------
    def execute(self, code: str, wall_seconds: float) -> Executed:
        """Run code in the sandbox, for at most ``wall_seconds`` of wall-clock time. A stop is a normal result here:
        ``Executed.stopped``."""
        outside = not self.exact  # a simulated motion is repeated after a power failure
        kind: Effect[Executed] = Effect("execute", self._keep_executed, self._read_executed, outside, world=True)
        return self._log.effect(kind, str(len(code)), lambda _: self._execute(code, wall_seconds))

    def settle(self, seconds: float) -> None:
        """Let objects come to rest. Raises ``Stopped``."""
        kind: Effect[None] = Effect("settle", self._keep_moved, self._read_moved, world=True)
        self._log.effect(kind, f"{seconds:g} s", lambda _: self._environment.settle(seconds))

    def checkpoint(self) -> bytes:
        """The state of the whole world; empty if it cannot be restored exactly."""
        kind: Effect[bytes] = Effect("checkpoint", self._keep_world, self._read_world)
        return self._log.effect(kind, "", lambda _: self._environment.checkpoint()) if self.exact else b""

    def restore(self, checkpoint: bytes) -> None:
        """Restore the state of the world exactly."""
        kind: Effect[None] = Effect("restore", lambda _: {"time": self._now()}, self._read_time, outside=True)
        self._log.effect(kind, "", lambda _: self._environment.restore(checkpoint))
        self._world, self._looks = checkpoint, []

    def _execute(self, code: str, wall_seconds: float) -> Executed:
        started, began = self._environment.time(), time.monotonic()
        session = self._session
        workspace = Workspace.around(self._environment.robot.reach, self.scene.table_height)
        try:
            execution = self._leaving.do(
                "moving",
                lambda: session.sandbox.run(
                    code,
                    self._environment.control,
                    stopped=lambda: session.stop.pressed or self._environment.link.stopped,
                    workspace=workspace,
                    on_call=session.emit,
                    clock=self._environment.time,
                    wall_seconds=wall_seconds,
                ),
            )
        except Stopped:
            execution = Execution("stopped", error="stopped", kind="stop")
        return Executed(execution, self._environment.time() - started, time.monotonic() - began)

    # -- people --------------------------------------------------------------------------------------------------------
    def hear(self, episode: Episode, after_a_stop: bool, words: WordStore) -> Heard:
        """The teacher's verdict on an episode. A correction is stored in ``words`` before it is processed. Raises
        ``Stopped``."""
        name = "feedback after a stop" if after_a_stop else "feedback"
        about = f"{episode.subtask}, attempt {episode.attempt}"
        return self._heard(name, about, lambda: self._person.judge(episode, after_a_stop), words, after_a_stop)

    def judge_task(self, episode: TaskEpisode, words: WordStore) -> Heard:
        """The teacher's verdict on the whole task. Raises ``Stopped``."""
        return self._heard("verdict on the task", "", lambda: self._person.judge_task(episode), words)

    def judge_plan(self, proposal: Proposal, words: WordStore) -> Heard:
        """The teacher's verdict on the planned subtask. Raises ``Stopped``."""
        return self._heard("verdict on the plan", proposal.subtask, lambda: self._person.judge_plan(proposal), words)

    def permit(self, program: Program, words: WordStore) -> Heard:
        """Whether a program may run; ``approve`` if no person has to be asked. Raises ``Stopped``."""
        if not self._person.permits:
            return Heard("approve")
        about = f"{program.subtask}, attempt {program.attempt}, {len(program.code)}"
        return self._heard("release of a program", about, lambda: self._person.permit(program), words)

    def read_back(self, noted: Noted, feedback: int, words: WordStore) -> Answered:
        """The person's reaction to the notes made of their words (``feedback``); accepted if nobody is asked. A
        rewording is stored in ``words``. Raises ``Stopped``."""
        kind: Effect[Answered] = Effect(
            "read back", self._keep_answered, lambda record: self._read_answered(record, words), outside=True
        )

        def ask(entry: int) -> Answered:
            answer = self._person.read_back(noted)
            if answer.kind != "reworded":
                return Answered(answer)
            if not answer.words.strip():
                return Answered(ReadBack("accepted"))
            return Answered(answer, words.keep(answer.words, entry, self._person.state()))

        def found(entry: int) -> Answered | None:
            kept = self._kept(words, entry)
            return None if kept is None else Answered(ReadBack("reworded", kept[1]), kept[0])

        return self._log.effect(kind, f"feedback {feedback}", ask, found)

    def _heard(
        self, name: str, about: str, put: Callable[[], Verdict], words: WordStore, after_a_stop: bool = False
    ) -> Heard:
        kind: Effect[Heard] = Effect(
            name,
            lambda heard: self._keep_heard(heard, after_a_stop),
            lambda record: self._read_heard(record, words),
            outside=self._person.watches,
            answers_stop=after_a_stop,
        )

        def ask(entry: int) -> Heard:
            verdict = put()
            if after_a_stop and verdict.kind != "correct":
                self._leaving.wait()  # the world is kept as it is now
            if verdict.kind != "correct" and not verdict.words:
                return Heard(verdict.kind)
            keeper = words if verdict.kind == "correct" else self._praise
            number = keeper.keep(verdict.words, entry, self._person.state())
            return Heard(verdict.kind, verdict.words, number)

        def found(entry: int) -> Heard | None:
            kept = self._kept(words, entry)
            return None if kept is None else Heard("correct", kept[1], kept[0])

        return self._log.effect(kind, about, ask, found)

    def _kept(self, words: WordStore, entry: int) -> tuple[int, str] | None:
        """Number and words that were stored before a crash; the teacher's state is restored with them."""
        kept = words.kept(entry)
        if kept is None:
            return None
        number, text, state = kept
        self._person.restore(state)
        return number, text

    def ending(self) -> bool:
        """Whether a person has ended the run."""
        return self._log.effect(Effect[bool]("ending?"), "", lambda _: self._person.has_ended())

    def release(self) -> None:
        """Let the robot move again after a stop was answered."""

        def release(_: int) -> None:
            self._leaving.wait()
            self._environment.stop_watching()  # where that had to wait for the robot to come to rest
            self._session.release()

        self._log.effect(Effect[None]("release", outside=True), "", release)

    def put_back(self, episode: Episode) -> bool:
        """Ask the teacher to put the scene back as it was in ``episode.before``; False if that was not done."""
        kind: Effect[bool] = Effect("put back by hand", outside=True, confirms=True)
        ask = self._person.put_back
        return self._person.puts_back and self._log.effect(kind, episode.subtask, lambda _: ask(episode))

    def confirm(self, episode: Episode) -> None:
        """Ask the teacher to confirm that the robot may continue from the present scene. Raises ``InvalidArgument``
        without confirmation."""
        kind: Effect[bool] = Effect("confirm the scene", outside=True, confirms=True)
        ask = self._person.confirm
        if not self._person.confirms or not self._log.effect(kind, episode.subtask, lambda _: ask(episode)):
            problem = f"what the robot did in {episode.subtask} before the interruption is in doubt"
            raise InvalidArgument("the world", problem, "somebody who looks and confirms the scene when asked")

    # -- the world of a resumed run ------------------------------------------------------------------------------------
    def _catch_up(self) -> None:
        """Bring the world to the state at the end of the log: restore the newest checkpoint and repeat the looks since.
        Raises ``LogMismatch`` if a look shows something else than it did."""
        if self.exact:
            if self._world:
                self._environment.restore(self._world)
            for logged in self._looks:
                if json.dumps(scene_record(self._environment.look())) != json.dumps(logged):
                    raise LogMismatch(str(self._log.folder), 0, "a look at its scene", "a look that shows another")
        self._person.restore(self._teacher)
        if self._seen is not None:
            self._environment.start_watching(tuple(self._seen))

    # -- how results are kept ------------------------------------------------------------------------------------------
    def _keep_scene(self, scene: SceneGraph) -> dict[str, Any]:
        return {"scene": scene_record(scene), "time": self._now()}

    def _read_scene(self, record: dict[str, Any]) -> SceneGraph:
        self._time = record["time"]
        return scene_of(record["scene"])

    def _keep_look(self, scene: SceneGraph) -> dict[str, Any]:
        record = self._kept_look(scene_record(scene))
        return record | {"pictures": self._files.keep(self.pictures)} if self.pictures else record

    def _read_look(self, record: dict[str, Any]) -> SceneGraph:
        self.pictures = self._files.read(record.get("pictures", ()))
        return scene_of(self._kept_look({name: value for name, value in record.items() if name != "pictures"}))

    def _kept_look(self, look: dict[str, Any]) -> dict[str, Any]:
        self._looks.append(look)
        return look

    def _keep_moved(self, _: object = None) -> dict[str, Any]:
        """Record the world as an effect left it, unless another thread is still using it after a stop."""
        record = {"time": self._now(), "seen": self._keep_seen()}
        return record | ({} if self._leaving.busy else self._keep_world())

    def _read_moved(self, record: dict[str, Any]) -> None:
        self._read_time(record)
        self._read_seen(record["seen"])
        if "world" in record:
            self._read_world(record)

    def _keep_world(self, checkpoint: bytes | None = None) -> dict[str, Any]:
        if not self.exact:
            return {}
        self._world, self._looks = self._environment.checkpoint() if checkpoint is None else checkpoint, []
        return {"world": base64.b85encode(zlib.compress(self._world, 1)).decode()}

    def _read_world(self, record: dict[str, Any]) -> bytes:
        self._world, self._looks = zlib.decompress(base64.b85decode(record["world"])), []
        return self._world

    def _keep_executed(self, executed: Executed) -> dict[str, Any]:
        execution = attrs.asdict(executed.execution, filter=attrs.filters.exclude("calls", "findings"))
        return {"execution": execution, "took_s": executed.took_s, "wall_s": executed.wall_s, **self._keep_moved()}

    def _read_executed(self, record: dict[str, Any]) -> Executed:
        self._read_moved(record)
        return Executed(read_as(Execution, record["execution"]), record["took_s"], record.get("wall_s", 0.0))

    def _now(self) -> float:
        self._time = float(self._environment.time())
        return self._time

    def _read_time(self, record: dict[str, Any]) -> None:
        self._time = record["time"]

    def _keep_seen(self, seen: Sequence[Sighting] | None = None) -> dict[str, Any] | None:
        """The sightings since they were last stored."""
        if self._seen is None:
            return None
        new = (self._environment.sightings() if seen is None else seen)[len(self._seen) :]
        self._seen += new
        return {"times": [one.time for one in new], "scenes": pack_scenes(one.scene for one in new)} if new else None

    def _read_seen(self, record: dict[str, Any] | None) -> tuple[Sighting, ...]:
        if record is not None and self._seen is not None:
            scenes = unpack_scenes(record["scenes"])
            self._seen += [Sighting(*one) for one in zip(record["times"], scenes, strict=True)]
        return tuple(self._seen or ())

    def _read_start(self, record: dict[str, Any] | None) -> None:
        self._read_seen(record)

    def _keep_heard(self, heard: Heard, after_a_stop: bool) -> dict[str, Any]:
        """The words by their id."""
        self._teacher = self._person.state()
        world = self._keep_world() if after_a_stop and heard.stays else {}
        return {"kind": heard.kind, "words": heard.feedback, "teacher": self._teacher, **world}

    def _keep_answered(self, answered: Answered) -> dict[str, Any]:
        self._teacher = self._person.state()
        answer = answered.answer
        return {
            "kind": answer.kind,
            "struck": list(answer.struck),
            "words": answered.feedback,
            "teacher": self._teacher,
        }

    def _read_answered(self, record: dict[str, Any], words: WordStore) -> Answered:
        self._teacher = record["teacher"]
        text = words.read(record["words"]) if record["words"] else ""
        return Answered(ReadBack(record["kind"], text, tuple(record["struck"])), record["words"])

    def _read_heard(self, record: dict[str, Any], words: WordStore) -> Heard:
        self._teacher = record["teacher"]
        if "world" in record:
            self._read_world(record)
        number, keeper = record["words"], words if record["kind"] == "correct" else self._praise
        return Heard(record["kind"], keeper.read(number) if number else "", number)
