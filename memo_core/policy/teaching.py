"""From feedback to entries (phases 3 and 4). Feedback is on disk before any model is asked about it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import attrs

from memo_core.errors import Stopped
from memo_core.events import EntryStored, EntryStruck, FeedbackGiven, NameCorrected, Problem
from memo_core.interfaces import teacher
from memo_core.interfaces.backend import Memory
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import Note as ReadNote
from memo_core.llm.readers import Unreadable
from memo_core.policy.attempt import Tried
from memo_core.policy.feedback_processing import NOT_NOW, Circumstances, Earlier, FeedbackProcessor, ProcessedFeedback
from memo_core.policy.learnt_functions import only_call, read_program, read_whole_template
from memo_core.policy.logged_book import BookWordStore, LoggedBook, feedback_of
from memo_core.policy.logged_person import Heard, LoggedPerson, WordStore
from memo_core.policy.model_questions import Questions
from memo_core.policy.run_context import Session
from memo_core.runlog.words_file import WordsFile
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import UNKNOWN, read_name_corrections, says_only_names
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.model.entries import Entry, Feedback, FeedbackKind, Reaction, key_label
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.result import RetrievedFunction
from memo_core.skills.contract import documentation
from memo_core.text.reading_limits import excerpt, too_long

ABOUT_NAMES = "it says what a thing is called: perception goes by it"
KEPT_BEFORE = "What I noted before is kept."  # where a rewording of it gave no note
READ_BACKS = 3  # of one remark: a rewording is noted and read back as well


@attrs.frozen
class NotedText:
    """A note as a prompt shows it: its key and its text."""

    key: str
    text: str


@attrs.frozen
class Corrected:
    """A correction of this run, as the next prompts show it: what was tried, what came of it, the person's words and
    the notes made of them."""

    subtask: str
    code: str
    printed: str
    ended: str
    words: str
    notes: tuple[NotedText, ...] = ()
    before: tuple[Tried, ...] = ()  # programs of the same attempt before that code, oldest first


@attrs.frozen(eq=False)
class Judged:
    """An attempt that somebody judged: the subtask, what the robot saw at its start, the code, and whether that code
    alone did what was seen. ``served``: entries it was written with; ``sources``: feedback that they derive from."""

    key: Key
    scene: SceneGraph
    code: str = ""
    worked: bool = False
    served: tuple[int, ...] = ()
    sources: tuple[int, ...] = ()
    printed: str = ""
    ended: str = ""  # what the code ended with, if it did
    functions: tuple[RetrievedFunction, ...] = ()  # that it could call
    before: tuple[Tried, ...] = ()  # programs of the same attempt before that code, oldest first


@attrs.define
class _Remark:
    """What somebody found fault with in this run, and what was made of it so far."""

    judged: Judged
    words: str
    feedback: int  # 0 where there is no book
    subtasks: tuple[Key, ...]  # of the run, then
    asked: tuple[str, str] = ("", "")
    entries: tuple[Entry, ...] = ()
    reworded: int = 0  # feedback whose notes, still ``entries``, go once its rewording gives notes


class Teaching:
    """Keeps feedback and makes entries of it. Without a book that can be written, only words are kept."""

    def __init__(self, session: Session, memory: Memory, questions: Questions, person: LoggedPerson) -> None:
        self._session = session
        self._memory = memory
        self._questions = questions
        self._person = person
        self._remarks: list[_Remark] = []  # of this run, oldest first
        self._stopped: set[int] = set()  # feedback whose reading a stop abandoned: not asked about again in this run
        self._raw = session.book if session.book is not None and not session.book.read_only else None
        self._book = LoggedBook(session, self._raw) if self._raw is not None else None
        self._file = WordsFile(session.log.folder, session.person.who)
        if self._book is not None:
            self._processor = FeedbackProcessor(questions.ask, self._book, session.emit, session.teaching)

    def store_for(self, judged: Judged) -> WordStore:
        """Where words about an attempt are kept, verbatim: in the book, or else in a file of the run."""
        book = self._raw
        if book is None:
            return self._file
        return BookWordStore(self._session.run, book, lambda words: self._record("correction", judged, words))

    def correct(self, judged: Judged, heard: Heard, after_a_stop: bool, subtasks: Sequence[Key] = ()) -> None:
        """An attempt, the plan or the whole task was corrected. Their words are kept already; what was
        served counts as used. ``subtasks``: those of the run so far."""
        number = heard.feedback if self._book is not None else 0
        words = excerpt(heard.words)
        self._remarks.append(_Remark(judged, words, number, tuple(dict.fromkeys(subtasks))))
        self._session.emit(FeedbackGiven(number, self._session.person.who, str(judged.key), words))
        if unread := too_long(heard.words) if self._book is None or not self._memory.any else "":
            self._problem(f"what was said of {judged.key}", unread)
        self._correct_names(judged, heard.words, number)
        if self._book is not None and not after_a_stop:
            self._book.note_use(judged.served, success=False, subtask=judged.key)

    def _correct_names(self, judged: Judged, words: str, feedback: int) -> None:
        """What the words say of names holds from the next look on; from the next run on as the book has them."""
        said = read_name_corrections(words, judged.scene, self._session.person.who, judged.key.objects)
        if said:
            self._session.environment.correct_names(said)
        for one in said:
            self._session.emit(NameCorrected(feedback, one.who, one.label, one.instead or UNKNOWN))

    def corrected(self, key: Key | None = None) -> list[Corrected]:
        """What was said in this run, oldest first; of one subtask, or of everything."""
        said = [one for one in self._remarks if key is None or one.judged.key == key]
        return [
            Corrected(
                str(one.judged.key),
                one.judged.code.rstrip("\n"),
                one.judged.printed.rstrip("\n"),
                one.judged.ended or "without an error",
                one.words,
                tuple(NotedText(key_label(entry.key), entry.text) for entry in one.entries if self._reads(entry)),
                one.judged.before,
            )
            for one in said
        ]

    def _reads(self, entry: Entry) -> bool:
        """Whether this method reads that kind of note: another one may be kept in the same book."""
        return self._memory.general if entry.kind == "general" else self._memory.corrections

    def noted(self, key: Key) -> frozenset[int]:
        """Entries that were made of what was said of a subtask in this run."""
        return frozenset(entry.id for one in self._remarks if one.judged.key == key for entry in one.entries)

    def process_pending(self) -> None:
        """Make entries of all feedback that none were made of yet, also from runs that ended early, and read those of
        this run back to the person. What a model cannot be asked about now stays pending, and so does what it was
        asked about when stop was pressed, for the rest of the run. Raises ``Stopped``."""
        if self._book is None or not self._memory.any:
            return
        for feedback in self._book.pending_feedback():
            if feedback.kind != "correction" or feedback.id in self._stopped:
                continue  # an approval whose template was never made lacks nothing that somebody said
            remark = next((one for one in self._remarks if one.feedback == feedback.id), None)
            if not self._process(feedback, remark):
                return

    def _process(self, feedback: Feedback, remark: _Remark | None) -> bool:
        """Note a remark and read the note back; returns whether a model can be asked about other feedback."""
        for _ in range(READ_BACKS):
            try:
                noted = self._processor.process(feedback, None if remark is None else self._circumstances(remark))
            except Stopped:
                self._stopped.add(feedback.id)
                later = "the next run with this skillbook, or `memo skillbook retry`, asks about it again"
                self._problem(
                    f"feedback {feedback.id} stays {feedback.status}",
                    f"stop was pressed while a model read it; {later}",
                )
                raise
            if noted.outcome == "pending":
                return not noted.away
            if remark is None:
                return True
            if noted.entries:
                self._replace(remark, noted)
            again = self._read_back(remark, noted)
            if again is None:
                return True
            remark.feedback, feedback = again.id, again
        return True

    def _circumstances(self, remark: _Remark) -> Circumstances:
        judged = remark.judged
        place = self._remarks.index(remark)
        before = [one for one in self._remarks[:place] if one.judged.key == judged.key]
        return Circumstances(
            judged.printed.rstrip("\n"),
            judged.ended or "without an error; a person found fault with what it did",
            tuple(Earlier(one.words, one.entries) for one in before),
            remark.subtasks,
            remark.asked,
            judged.before,
            self._reads_back,
        )

    @property
    def _reads_back(self) -> bool:
        return self._session.person.reads_back and self._session.teaching.read_back

    def _read_back(self, remark: _Remark, noted: ProcessedFeedback) -> Feedback | None:
        """Read what was noted back to the person and do as they say. What they said instead, to be noted; None where
        there is none."""
        assert self._book is not None and self._raw is not None
        if not self._reads_back:
            return None
        notes = tuple(ReadNote(one.text, str(one.key) if one.key.objects else "") for one in noted.entries)
        question = noted.question or ("" if notes else "I could make nothing of that. What should I do differently?")
        asked = f"{KEPT_BEFORE} {question}" if remark.reworded else question
        shown = teacher.Noted(remark.words, str(remark.judged.key), notes, asked)
        answered = self._person.read_back(shown, remark.feedback, self.store_for(remark.judged))
        answer = answered.answer
        if answer.kind == "reworded":
            remark.reworded = remark.reworded or (remark.feedback if notes else 0)
        elif notes:
            gone = () if answer.kind == "accepted" else answer.struck or range(len(notes))
            self._settle(remark, remark.feedback, [entry for place, entry in enumerate(noted.entries) if place in gone])
        elif remark.reworded:
            self._settle(remark, remark.reworded, [])
        if answer.kind != "reworded":
            return None
        if not notes:
            remark.asked = (remark.words, question)
        remark.words = f"{remark.words.rstrip()}\n{excerpt(answer.words).strip()}"
        return feedback_of(self._raw, answered.feedback)

    def _replace(self, remark: _Remark, noted: ProcessedFeedback) -> None:
        """Replace the reworded notes of a remark by the notes made of the new words."""
        if remark.reworded:
            self._settle(remark, remark.reworded, remark.entries)
        remark.entries, remark.reworded = noted.entries, 0

    def _settle(self, remark: _Remark, feedback: int, gone: Sequence[Entry]) -> None:
        """Store the person's reaction to the notes of a remark: ``gone`` are struck, the others accepted."""
        assert self._book is not None
        struck = {entry.id for entry in gone}
        said = [Reaction(entry.id, "struck" if entry.id in struck else "accepted") for entry in remark.entries]
        remark.entries = self._book.read_back(feedback, said)
        for entry in gone:
            self._session.emit(EntryStruck(entry.id, entry.kind, key_label(entry.key), entry.text, feedback))

    @property
    def makes_templates(self) -> bool:
        return self._book is not None and self._memory.templates

    def merge(self, judged: Judged, programs: Sequence[Tried], restarted: bool) -> str | None:
        """One program made of those that did a subtask together; None where the model has none to offer. Raises
        ``Stopped``, ``BudgetExceeded``."""
        try:
            code, _ = self._questions.ask(
                "merge",
                judged.scene,
                partial(read_program, functions=judged.functions),
                subtask=str(judged.key),
                skills=documentation(self._session.skills),
                subset=self._session.sandbox.subset(),
                programs=programs,
                restart=restarted,
            )
        except (Unreadable, LanguageModelError) as error:
            self._problem(f"the programs for {judged.key} were not merged", str(error))
            return None
        return code

    def keep_candidate(self, judged: Judged, code: str) -> None:
        """Keep merged code that cannot be tried from the start, as an approval without a template."""
        if self._book is None:
            return
        candidate = attrs.evolve(judged, code=code)
        about = str(judged.key)
        number = self._book.record_approval(lambda: self._record("approval", candidate, ""), f"candidate for {about}")
        self._book.park(number, "a candidate: merged of several programs and never run by itself")

    def approve(self, judged: Judged, heard: Heard) -> None:
        """Turn code that a person approved into a template under the subtask's key, if it ``worked`` by itself. Raises
        ``Stopped``."""
        if not judged.worked:
            failed = "approved although its program failed; no template is made of it"
            begun = "approved, but no template: the code needed several beginnings"
            self._problem(str(judged.key), failed if judged.ended else begun)
        if self._book is None:
            return
        self._book.note_use(judged.served, success=True, subtask=judged.key)
        about = str(judged.key)
        approval = self._book.record_approval(lambda: self._record("approval", judged, heard.words), about)
        if not self._memory.templates or not judged.worked:
            return
        if (called := only_call(judged.code, judged.functions)) is not None:
            self._keep_call(approval, judged, *called)
            return
        try:
            read = partial(read_whole_template, functions=judged.functions)
            template, _ = self._questions.ask(
                "template", judged.scene, read, subtask=about, code=judged.code, printed=judged.printed
            )
        except Unreadable as error:
            self._book.park(approval, error.problem)
            self._problem(f"no template for {about}", str(error))
            return
        except (*NOT_NOW, Stopped) as error:
            # Pending is what somebody said and nobody made anything of yet; here nothing more will be made.
            self._book.park(approval, f"no template was made: {error}")
            if not isinstance(error, LanguageModelError):
                raise
            self._problem(f"no template for {about}", str(error))
            return
        entry = self._book.add_template(approval, judged.key, template, judged.scene.label, judged.sources)
        self._session.emit(EntryStored(entry.id, entry.kind, about, entry.text, approval))

    def _keep_call(self, approval: int, judged: Judged, function: RetrievedFunction, call: str) -> None:
        """Keep an approved program that was one call of a learnt function as that call: no template need be made."""
        assert self._book is not None
        more = (judged.scene.label, judged.sources)
        entry = self._book.add_call(approval, judged.key, call, function.entry.id, *more)
        self._session.emit(EntryStored(entry.id, entry.kind, str(judged.key), entry.text, approval))

    def _record(self, kind: FeedbackKind, judged: Judged, words: str) -> int:
        assert self._raw is not None
        makes = self._memory.any if kind == "correction" else self._memory.templates and judged.worked
        named = kind == "correction" and says_only_names(words, judged.scene, judged.key.objects)
        return self._raw.record_feedback(
            words,
            self._session.person.who,
            task=self._session.environment.instruction,
            subtask=str(judged.key),
            scene=judged.scene.label,
            scene_graph=scene_table(judged.scene),
            code=judged.code,
            run=self._session.run,
            kind=kind,
            kept_only=ABOUT_NAMES
            if named
            else ""
            if makes
            else "kept for the record: nothing was to be made of it in this run",
        )

    def _problem(self, where: str, message: str) -> None:
        self._session.emit(Problem(where, message))
