"""The teacher of a run as the person that a method asks: in the thread that owns the terminal, with films and pictures
of what is judged."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.events import Event, QuestionAsked
from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, TaskEpisode, Teacher, Verdict
from memo_core.policy.person import Person
from memo_core.runs.filming import Filmed
from memo_core.runs.signal_handling import Supervisor


class WatchingTeacher(Person):
    """Questions go to the ``teacher`` through the ``supervisor``; None: nobody watches.

    Args:
        releases: whether each program waits for the teacher's permission.
        resets: whether the teacher can put the scene back.
        tell: called with an event for each question.
        time_is_up: see ``Person.time_is_up``; None: the teacher has all the time.
    """

    def __init__(
        self,
        teacher: Teacher | None,
        supervisor: Supervisor,
        filmed: Filmed,
        releases: bool,
        resets: bool,
        tell: Callable[[Event], None] = lambda event: None,
        time_is_up: Callable[[float, int, int], bool] | None = None,
    ) -> None:
        self._teacher, self._supervisor, self._filmed = teacher, supervisor, filmed
        self._tell = tell
        self._time_is_up = time_is_up
        self.who = teacher.who if teacher is not None else "nobody"
        self.watches = self.confirms = teacher is not None
        # A teacher who has nothing to say to plans is not shown each of them.
        self.judges_plans = teacher is not None and type(teacher).judge_plan is not Teacher.judge_plan
        self.reads_back = teacher is not None and teacher.reads_back
        self.permits = releases
        self.puts_back = teacher is not None and resets
        self.has_limited_time = time_is_up is not None

    def judge(self, episode: Episode, interrupted: bool) -> Verdict:
        self._announce("stop" if interrupted else "attempt", episode.subtask)
        return self._supervisor.ask(self._filmed.shown(episode), interrupted)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        self._announce("task")
        return self._supervisor.judge_task(self._filmed.shown(episode))

    def judge_plan(self, proposal: Proposal) -> Verdict:
        self._announce("plan", proposal.subtask)
        return self._supervisor.judge_plan(proposal)

    def read_back(self, noted: Noted) -> ReadBack:
        self._announce("notes", noted.subtask)
        return self._supervisor.read_back(noted)

    def permit(self, program: Program) -> Verdict:
        self._announce("program", program.subtask)
        return self._supervisor.permit(program)

    def put_back(self, episode: Episode) -> bool:
        self._announce("put back", episode.subtask)
        return self._supervisor.put_back(self._filmed.with_pictures(episode))

    def confirm(self, episode: Episode) -> bool:
        self._announce("confirm", episode.subtask)
        return self._supervisor.confirm(episode)

    def _announce(self, about: str, subtask: str = "") -> None:
        if self._teacher is not None and not self._supervisor.ending:
            self._tell(QuestionAsked(about, subtask))

    def has_ended(self) -> bool:
        return self._supervisor.ending

    def time_is_up(self, robot_s: float, attempts: int, calls: int) -> bool:
        return self._time_is_up is not None and self._time_is_up(robot_s, attempts, calls)

    def state(self) -> str:
        return self._teacher.state() if self._teacher is not None else ""

    def restore(self, state: str) -> None:
        if self._teacher is not None and state:
            self._teacher.restore(state)
