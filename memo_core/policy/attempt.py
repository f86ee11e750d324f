"""Phase 2 and execution: one attempt at a subtask, from what is retrieved to code that ran."""

from __future__ import annotations

from collections.abc import Sequence

import attrs

from memo_core.errors import Stopped
from memo_core.events import CodeEnded, CodeWritten
from memo_core.interfaces.teacher import Sighting
from memo_core.policy.asking import Questions
from memo_core.policy.progress import Tried
from memo_core.policy.readers import read_code
from memo_core.policy.retrieving import Served
from memo_core.policy.session import Session
from memo_core.policy.stopping import Leaving
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.keys import Key
from memo_core.skills.contract import documentation


@attrs.define
class Attempt:
    """What is known of the attempt at hand, also when it is interrupted half-way."""

    number: int
    scene: SceneGraph  # as the robot saw it at the start
    take: int = 1
    code: str = ""  # the last that was written
    whole: bool = False  # that code alone, from the subtask's start, is what happened
    succeeded: bool = False  # it ran to its end
    error: str = ""
    printed: str = ""
    served: Served = attrs.field(factory=Served)
    watched: tuple[Sighting, ...] = ()


class Coding:
    """Has code written for a subtask and runs it, again after errors."""

    def __init__(self, session: Session, questions: Questions, leaving: Leaving, table_height: float) -> None:
        self._session = session
        self._stage = session.stage
        self._settings = session.settings
        self._questions = questions
        self._leaving = leaving
        self._workspace = Workspace.around(self._stage.robot.reach, table_height)

    def write_and_execute(self, key: Key, attempt: Attempt, history: Sequence[Tried], done: Sequence[str]) -> None:
        """Fills in ``attempt``. ``done``: what the prompt says of earlier subtasks. Raises ``Stopped``,
        ``LanguageModelError``, ``Unreadable``."""
        tried = list(history)
        moved = False
        for repair in range(self._settings.repairs + 1):
            code = self._write(key, attempt, tried, repair, done)
            if tried and repair and code == tried[-1].code:
                break  # the model has no other idea: what would go wrong is known
            attempt.code = code
            attempt.whole = not moved
            start = self._stage.time()
            execution = self._execute(key, attempt)
            moved = moved or self._stage.time() > start
            attempt.error, attempt.printed = execution.error, execution.printed
            attempt.succeeded = execution.succeeded
            if execution.succeeded:
                break
            tried.append(Tried(attempt.code, execution.printed.rstrip("\n"), execution.error))
        self._stage.settle(self._settings.settle_s)

    def _write(self, key: Key, attempt: Attempt, tried: Sequence[Tried], repair: int, done: Sequence[str]) -> str:
        session, served = self._session, attempt.served
        code, asked = self._questions.ask(
            "code",
            self._stage.look(),
            read_code,
            task=self._stage.instruction,
            subtask=str(key),
            done=done,
            skills=documentation(session.skills),
            subset=session.sandbox.subset(),
            corrections=served.corrections,
            general=served.general,
            templates=served.templates,
            attempts=tried,
        )
        session.journal.code(str(key), attempt.number, repair, code, attempt.take)
        session.emit(CodeWritten(str(key), attempt.number, code, asked.file))
        return code

    def _execute(self, key: Key, attempt: Attempt) -> Execution:
        started = self._stage.time()
        try:
            execution = self._leaving.do("moving", lambda: self._run_code(attempt.code))
        except Stopped:
            execution = Execution("stopped", error="stopped", kind="stop")
        stopped = execution.ended == "stopped"
        took = self._stage.time() - started
        self._session.emit(CodeEnded(str(key), attempt.number, execution.printed, execution.error, stopped, took))
        if stopped:
            raise Stopped("moving")
        return execution

    def _run_code(self, code: str) -> Execution:
        return self._session.sandbox.run(
            code,
            self._stage.control,
            stopped=self._stopped,
            workspace=self._workspace,
            on_call=self._session.emit,
            clock=self._stage.time,
        )

    def _stopped(self) -> bool:
        return self._session.stop.pressed or self._stage.link.stopped
