"""Calls of models: asked again only where that may help, never past a stop or a budget, each kept with what it cost."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import cattrs
import pytest
from hypothesis import given, strategies as st

from memo_core.cli.main import main
from memo_core.errors import BackendUnavailable, InvalidArgument, Stopped
from memo_core.events import ModelCalled, Problem
from memo_core.interfaces.llm import Answer, LanguageModelError, Message, Request, Usage
from memo_core.llm.budget import Budget, BudgetExceeded, Limit, UnknownPrice
from memo_core.llm.calls import LONGEST_WAIT_S, ModelCalls, Retrying
from memo_core.llm.ledger import Ledger, LedgerError, read_ledger
from memo_core.llm.readers import Unreadable
from memo_core.llm.spending import Spent
from memo_core.policy.model_questions import put
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.log_file import FILE, read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runlog.run_log import RunLog
from memo_core.runs.factories import budget_of
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.text.redaction import Redactor

QUESTION = Request("plan", (Message("user", "What is next, please?"),))


def may_pass(**more) -> LanguageModelError:
    return LanguageModelError("scripted", "overloaded", True, **more)


class KeptFiles(RunLog):
    """A log in memory whose files are kept as what they say."""

    def __init__(self) -> None:
        super().__init__()
        self.kept_calls: list[tuple] = []
        self.unusable: list[str] = []

    def write(self, name: str, text: str) -> str:
        kept = json.loads(text)
        answer = None if kept["answer"] is None else cattrs.structure(kept["answer"], Answer)
        usage = None if kept["usage"] is None else Usage(**kept["usage"])
        self.unusable.append(kept["unusable"])
        self.kept_calls.append((answer, kept["problem"], kept["abandoned"], usage))
        return f"calls/{len(self.kept_calls)}.json"


class Bench:
    """Calls of a scripted model, and everything that was kept of them."""

    def __init__(self, script, budget: Budget | None = None, retrying: Retrying = Retrying(3, 0.01), **how):
        self.llm = script if hasattr(script, "answer") else ScriptedModel({"plan": script})
        self.stop = StopSwitch()
        self.events: list = []
        self.log = KeptFiles()
        self.budget = budget or Budget()
        self.calls = ModelCalls(self.llm, self.stop, self.log, self.events.append, self.budget, retrying, **how)

    @property
    def kept(self) -> list[tuple]:
        return self.log.kept_calls

    def of(self, kind) -> list:
        return [event for event in self.events if isinstance(event, kind)]


# -- asking again ------------------------------------------------------------------------------------------------------
def test_what_may_pass_is_asked_again_and_every_call_is_kept():
    bench = Bench([may_pass(), may_pass(usage=Usage(50, 2, 0.5)), "GO(home)"])
    answer, file = bench.calls.answer(QUESTION)
    assert (answer.text, file) == ("GO(home)", "calls/3.json")
    assert [problem[-10:] for _, problem, _, _ in bench.kept] == ["overloaded", "overloaded", ""]
    called = bench.of(ModelCalled)
    assert [bool(event.problem) for event in called] == [True, True, False]
    assert bench.budget.spent.calls == 3
    assert bench.budget.spent.prompt_tokens == sum(event.prompt_tokens for event in called) == 50 + 4
    assert bench.budget.spent.cost == pytest.approx(0.5 + 0.004)
    assert "asked again in" in bench.of(Problem)[0].message


def test_a_problem_that_stays_the_same_is_said_in_full_once():
    long = LanguageModelError("scripted", "overloaded " * 20, True)
    bench = Bench([long, long, may_pass(), "GO(home)"])
    bench.calls.answer(QUESTION)
    first, second, other = [event.message for event in bench.of(Problem)]
    assert str(long) in first
    assert second.startswith("the same again; asked again in") and "(2 of 3)" in second
    assert other.startswith(str(may_pass()))


def test_why_an_answer_cannot_be_used_is_in_its_event_and_its_file_as_the_model_is_told():
    def read(text: str) -> str:
        if "GO" not in text:
            raise Unreadable("plan", "it names no subtask", text)
        return text

    bench = Bench(["I would rather not.", Answer("GO(", "length"), "GO(home)"])
    text, _ = put(bench.calls, "plan", QUESTION.messages, read, 2)
    assert text == "GO(home)"
    reasons = [event.unusable for event in bench.of(ModelCalled)]
    assert reasons == ["it names no subtask", "it was cut off at the model's length limit; answer more briefly", ""]
    assert bench.log.unusable == reasons
    for asked, reason in zip(bench.llm.asked[1:], reasons, strict=False):
        assert f"cannot be used: {reason}." in asked.messages[-1].text


def test_what_will_not_pass_is_not_asked_again():
    bench = Bench([LanguageModelError("scripted", "no such model"), "never"])
    with pytest.raises(LanguageModelError, match="no such model"):
        bench.calls.answer(QUESTION)
    assert len(bench.llm.asked) == 1


def test_a_call_that_ends_in_an_error_of_another_kind_is_kept_and_over():
    class Broken(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            raise InvalidArgument("llm.options", "unknown", "another")

    bench = Bench(Broken({}))
    with pytest.raises(InvalidArgument):
        bench.calls.answer(QUESTION)
    assert bench.budget.under_way == 0 and len(bench.kept) == 1
    assert "llm.options" in bench.of(ModelCalled)[0].problem


def test_an_error_of_a_kind_of_its_own_is_told_with_the_name_of_the_model(monkeypatch, capsys):
    class Broken(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            return {}["choices"]

    bench = Bench(Broken({}))
    monkeypatch.setattr("memo_core.cli.app.run_app", lambda given: bench.calls.answer(QUESTION))
    with pytest.raises(SystemExit) as ended:
        main(["run"])
    assert ended.value.code == 70
    said = "unexpected KeyError: 'choices' (raised while llm 'scripted' answered; memo --debug shows where)"
    assert said in capsys.readouterr().err


def test_an_answer_that_is_only_text_is_told_as_the_plugins_mistake():
    class Broken(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            return "OPEN(door)"

    bench = Bench(Broken({}))
    with pytest.raises(BackendUnavailable) as raised:
        bench.calls.answer(QUESTION)
    said = r"llm 'scripted' cannot be used: its answer() returned str, not an Answer(text, …) (a bug in its plugin)"
    assert str(raised.value) == said
    assert bench.budget.under_way == 0 and len(bench.kept) == 1


def calls_in(folder: Path, script, resumed: bool = False) -> ModelCalls:
    """Calls whose log is in a folder."""
    log = RunLog(folder, read_history(folder, read_lines(folder).records) if resumed else None)
    log.begin({"run": "run-1", "task": "open the door"}, {})
    model = ScriptedModel({"plan": script})
    return ModelCalls(model, StopSwitch(), log, lambda event: None, Budget(), Retrying(0, 0.0))


@pytest.mark.parametrize("killed", ["after the log knew", "before the log knew"])
@pytest.mark.parametrize("known", [True, False], ids=["kept with its cause", "kept by an earlier version"])
def test_a_resumed_run_sees_the_same_error(killed, known, tmp_path):
    error = LanguageModelError("scripted", "no credit", False, 7.0, Usage(5, 1), "quota")
    with pytest.raises(LanguageModelError):
        calls_in(tmp_path, [error]).answer(QUESTION)
    if killed == "before the log knew":
        lines = (tmp_path / FILE).read_text().splitlines(keepends=True)
        end = next(number for number, line in enumerate(lines) if '"end": "ask a model"' in line)
        (tmp_path / FILE).write_text("".join(lines[:end]))
    [file] = (tmp_path / "calls").iterdir()
    kept = json.loads(file.read_text())
    if not known:
        kept.pop("error")
        file.write_text(json.dumps(kept))
    with pytest.raises(LanguageModelError, match="no credit") as again:
        calls_in(tmp_path, ["never asked"], resumed=True).answer(QUESTION)
    assert again.value.usage == error.usage and not again.value.retryable
    if known or killed == "after the log knew":
        assert str(again.value) == str(error)
        assert (again.value.cause, again.value.retry_after_s) == (error.cause, error.retry_after_s)


def test_it_is_asked_again_so_often_and_no_more():
    bench = Bench([may_pass()] * 9, retrying=Retrying(2, 0.0))
    with pytest.raises(LanguageModelError, match="overloaded"):
        bench.calls.answer(QUESTION)
    assert len(bench.llm.asked) == 3


@given(st.integers(0, 6), st.floats(0.0, 300.0), st.booleans(), st.floats(0.0, 8.0))
def test_a_wait_is_never_shorter_than_the_server_asks_nor_longer_than_is_bearable(attempt, asked, retryable, first):
    wait = Retrying(4, first).wait_s(attempt, LanguageModelError("x", "y", retryable, asked))
    if not retryable or attempt >= 4 or asked > LONGEST_WAIT_S:
        assert wait is None
    else:
        assert wait is not None and asked <= wait <= LONGEST_WAIT_S
        assert wait == asked or wait >= min(30.0, first * 2**attempt) * 0.75


def test_waits_grow_and_differ():
    waits = [[Retrying().wait_s(attempt, may_pass()) for attempt in range(3)] for _ in range(20)]
    assert all(first < second < third for first, second, third in waits)
    assert len({first for first, *_ in waits}) > 1


def test_a_stop_ends_the_wait_at_once():
    bench = Bench([may_pass(retry_after_s=60.0), "never"])
    threading.Timer(0.2, bench.stop.press).start()
    started = time.monotonic()
    with pytest.raises(Stopped):
        bench.calls.answer(QUESTION)
    assert time.monotonic() - started < 30.0 and len(bench.llm.asked) == 1


def test_a_call_that_is_given_up_is_told_so_and_what_it_cost_is_kept():
    told = threading.Event()

    class Patient(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            self.called.set()
            while not cancelled():
                time.sleep(0.005)
            told.set()
            raise LanguageModelError("patient", "given up", usage=Usage(30, 4, 0.25))

    bench = Bench(Patient({}))
    threading.Thread(target=lambda: (bench.llm.called.wait(), bench.stop.press())).start()
    with pytest.raises(Stopped):
        bench.calls.answer(QUESTION)
    bench.budget.wait(30.0)
    assert told.is_set() and bench.budget.under_way == 0
    [(answer, problem, abandoned, usage)] = bench.kept
    assert answer is None and "given up" in problem and abandoned and usage.cost == 0.25
    assert bench.budget.spent == Spent(1, 30, 4, 0.25)


def test_pieces_are_shown_until_it_is_given_up():
    class Talker(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            for word in ("one ", "two ", "three"):
                on_text(word)
            return Answer("one two three")

    shown: list = []
    bench = Bench(Talker({}), on_text=lambda phase, piece: shown.append((phase, piece)))
    bench.calls.answer(QUESTION)
    assert shown == [("plan", "one "), ("plan", "two "), ("plan", "three")]


# -- budgets -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("limit", "setting"), [(Limit(max_tokens=13), "max_tokens"), (Limit(max_cost=0.008), "max_cost")]
)
def test_a_budget_ends_the_asking_and_says_what_was_spent(limit, setting):
    bench = Bench(["one"] * 9, Budget(limit))
    with pytest.raises(BudgetExceeded) as raised:
        for _ in range(9):
            bench.calls.answer(QUESTION)
    assert len(bench.llm.asked) == (3 if setting == "max_tokens" else 2)
    assert f"run.{setting}" in str(raised.value) and raised.value.spent.said() in str(raised.value)
    assert not isinstance(raised.value, LanguageModelError), "it must end the run, not the subtask"


def test_retries_count_towards_the_budget():
    bench = Bench([may_pass(usage=Usage(100, 0, 0.1))] * 9, Budget(Limit(max_tokens=150)))
    with pytest.raises(BudgetExceeded):
        bench.calls.answer(QUESTION)
    assert len(bench.llm.asked) == 2


class Unpriced(ScriptedModel):
    def unpriced(self) -> str:
        return "nobody knows the price; set llm.prompt_price"


def test_a_limit_in_dollars_needs_a_price_before_the_first_call():
    with pytest.raises(
        UnknownPrice, match=r"run\.max_cost cannot be kept: nobody knows the price; set llm\.prompt_price"
    ):
        Budget(Limit(max_cost=1.0)).open(Unpriced({}))
    Budget(Limit(max_tokens=10)).open(Unpriced({}))


def test_a_model_that_had_promised_a_price_is_not_asked_on_without_it():
    class Forgetful(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            self.asked.append(request)
            return Answer("x", usage=Usage(5, 5, None))

    bench = Bench(Forgetful({}), Budget(Limit(max_cost=1.0)))
    bench.calls.answer(QUESTION)
    with pytest.raises(UnknownPrice):
        bench.calls.answer(QUESTION)
    assert len(bench.llm.asked) == 1


def test_a_resumed_run_goes_on_counting():
    with pytest.raises(BudgetExceeded, match="this run"):
        Budget(Limit(max_tokens=10), already=Spent(3, 8, 2)).open(ScriptedModel({}))


def test_a_studys_limit_needs_a_ledger():
    with pytest.raises(InvalidArgument, match="study_ledger"):
        RunSettings(study_max_cost=1.0)


def test_runs_that_share_a_ledger_share_its_limit(tmp_path: Path):
    settings = RunSettings(study_ledger=str(tmp_path / "study.ledger"), study_max_tokens=12)
    first, second = (Bench(["one"] * 9, budget_of(settings, name)) for name in ("run-1", "run-2"))
    first.budget.open(first.llm)
    second.budget.open(second.llm)
    first.calls.answer(QUESTION)
    second.calls.answer(QUESTION)
    first.calls.answer(QUESTION)
    with pytest.raises(
        BudgetExceeded, match=r"the study of .*study\.ledger may spend no more: run\.study_max_tokens is 12"
    ):
        second.calls.answer(QUESTION)
    first.budget.close()
    second.budget.close()
    ledger = Ledger(tmp_path / "study.ledger")
    assert [(run, spent.calls) for run, spent in read_ledger(ledger.path)[0]] == [("run-1", 2), ("run-2", 1)]
    assert ledger.spent().tokens == 15
    with pytest.raises(BudgetExceeded):
        budget_of(settings, "run-3").open(ScriptedModel({}))


SPEND = """
import sys, time
from pathlib import Path
from memo_core.interfaces.llm import Message, Request, Usage
from memo_core.llm.budget import Budget, BudgetExceeded, Limit
from memo_core.llm.ledger import Ledger
budget = Budget(ledger=Ledger(Path(sys.argv[1])), study=Limit(max_tokens=400), run=sys.argv[2])
question, made = Request("plan", (Message("user", "hi"),)), 0
try:
    while True:
        number = budget.begin(question, "m")
        budget.end(number, Usage(9, 1, 0.01))
        made += 1
except BudgetExceeded:
    print(made)
"""


@pytest.mark.process
def test_several_processes_spend_no_more_than_one_call_each_too_much(tmp_path: Path):
    path = tmp_path / "study.ledger"
    runs = [
        subprocess.Popen([sys.executable, "-c", SPEND, str(path), f"run-{n}"], stdout=subprocess.PIPE, text=True)
        for n in range(3)
    ]
    made = [int(run.communicate(timeout=60)[0]) for run in runs]
    spent = Ledger(path).spent()
    assert spent.calls == sum(made) and 40 <= spent.calls <= 40 + len(runs)
    assert spent.cost == pytest.approx(0.01 * sum(made)) and spent.unfinished == 0


def test_nobody_gets_in_between_a_look_at_the_ledger_and_the_line(tmp_path: Path):
    path = tmp_path / "study.ledger"
    seen: list[Spent] = []
    other = threading.Thread(target=lambda: Ledger(path).begin("other", "plan", "m", 5, seen.append))

    def look(spent: Spent) -> None:
        other.start()
        other.join(0.3)
        assert other.is_alive(), "it did not wait"

    Ledger(path).begin("one", "plan", "m", 7, look)
    other.join(10.0)
    assert [spent.prompt_tokens for spent in seen] == [7]


@pytest.mark.process
def test_a_call_whose_run_was_killed_stays_in_the_ledger(tmp_path: Path):
    path = tmp_path / "study.ledger"
    code = SPEND.replace("budget.end(number, Usage(9, 1, 0.01))", "import os; os.kill(os.getpid(), 9)")
    assert subprocess.run([sys.executable, "-c", code, str(path), "killed"], timeout=60).returncode == -9
    spent = Ledger(path).spent()
    assert (spent.calls, spent.unfinished) == (1, 1) and "1 unfinished" in spent.said()


def test_a_ledger_that_is_none_is_said(tmp_path: Path):
    path = tmp_path / "notes.txt"
    path.write_text("these are my notes, not a database\n" * 100)
    with pytest.raises(LedgerError, match=r"notes\.txt"):
        Ledger(path).spent()
    assert path.read_text().startswith("these are my notes")
    with pytest.raises(LedgerError):
        Ledger(tmp_path / "notes.txt" / "study.ledger").open()
    with sqlite3.connect(tmp_path / "damaged") as connection:
        connection.execute("CREATE TABLE calls (a)")
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute("UPDATE sqlite_master SET sql = CAST(X'4352458B' AS TEXT)")
    connection.close()
    for read in (Ledger(tmp_path / "damaged").spent, lambda: read_ledger(tmp_path / "damaged")):
        with pytest.raises(LedgerError, match="damaged"):
            read()


# -- secrets -----------------------------------------------------------------------------------------------------------
SECRET = 'sk-"quoted"\\and/long+enough'
REDACT = Redactor.of_environment(
    ["MY_OWN"], {"OPENAI_API_KEY": SECRET, "MY_OWN": "my-own-secret", "HOME": "home-folder"}
)


@pytest.mark.parametrize(
    "spelling", [SECRET, SECRET.replace("\\", "\\\\").replace('"', '\\"'), "sk-%22quoted%22%5Cand%2Flong%2Benough"]
)
def test_a_secret_is_found_however_it_is_written(spelling):
    assert REDACT(f"the key {spelling} is wrong") == "the key [OPENAI_API_KEY] is wrong"


def test_what_is_no_secret_stays():
    assert REDACT("home-folder, my-own-secret, postgresql://memo:pass@host/x") == (
        "home-folder, [MY_OWN], postgresql://[password]@host/x"
    )
    assert Redactor.of_environment(environment={"A_KEY": "short"})("short and sweet") == "short and sweet"


@given(st.lists(st.sampled_from(["my-own-", "secret", "my-own-secret", "s", " and ", "my-o", "m", ""]), max_size=12))
def test_pieces_show_what_the_whole_would_and_never_a_secret(pieces):
    shown: list[str] = []
    receive = REDACT.pieces(shown.append)
    for piece in pieces:
        receive(piece)
    receive.end()
    assert "".join(shown) == REDACT("".join(pieces))
    assert "my-own-secret" not in "".join(shown)


def test_a_secret_that_a_model_repeats_goes_no_further(monkeypatch):
    monkeypatch.setenv("LAB_TOKEN", "planted-0123456789")
    shown: list = []

    class Parrot(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            for piece in ("it is plan", "ted-012345", "6789."):
                on_text(piece)
            return Answer("it is planted-0123456789.")

    bench = Bench(Parrot({}), on_text=lambda phase, piece: shown.append(piece))
    answer, _ = bench.calls.answer(QUESTION)
    assert answer.text == "it is [LAB_TOKEN]." == "".join(shown)
    broken = Bench([LanguageModelError("scripted", "who is planted-0123456789?")])
    with pytest.raises(LanguageModelError, match=r"who is \[LAB_TOKEN\]") as raised:
        broken.calls.answer(QUESTION)
    assert "planted" not in str(raised.value) + str(broken.kept) + str(broken.events)


def test_the_ledger_hears_of_a_call_whose_process_was_killed_before_it_could_say_what_it_cost(tmp_path):
    ledger, budget = Ledger(tmp_path / "ledger"), Budget(ledger=Ledger(tmp_path / "ledger"), run="one")
    budget.open(ScriptedModel({}))
    for entry in (3, 3, 8, 9):  # the first of entry 3 was cut off and its question put again
        budget.begin(QUESTION, "m", entry)
    Budget(ledger=ledger, run="two", known={3: Usage(50, 1, 0.1)}).open(ScriptedModel({}))
    assert ledger.spent().unfinished == 4, "another run's calls"
    resumed = Budget(ledger=ledger, run="one", known={3: Usage(50, 1, 0.1), 8: None, 12: Usage(7, 7, 7.0)})
    resumed.open(ScriptedModel({}))
    spent = ledger.spent()
    assert (spent.calls, spent.unfinished, spent.completion_tokens, spent.cost) == (4, 2, 1, 0.1)
    resumed.open(ScriptedModel({}))
    assert ledger.spent() == spent, "once"


def test_a_ledger_of_an_older_version_is_gone_on_with(tmp_path):
    with sqlite3.connect(tmp_path / "ledger") as old:
        old.execute(
            "CREATE TABLE calls (id INTEGER PRIMARY KEY, begun REAL NOT NULL, ended REAL, run TEXT NOT NULL, phase TEXT"
            " NOT NULL, model TEXT NOT NULL, prompt_tokens INTEGER NOT NULL, completion_tokens INTEGER NOT NULL DEFAULT"
            " 0, cost REAL)"
        )
        old.execute("INSERT INTO calls VALUES (1, 1.0, 2.0, 'old', 'plan', 'm', 10, 5, 0.5)")
    ledger = Ledger(tmp_path / "ledger")
    ledger.end(ledger.begin("new", "plan", "m", 1, lambda spent: None, 4), Usage(20, 5, 0.5))
    assert (ledger.spent().calls, ledger.spent().tokens) == (2, 40)


def test_what_was_spent_is_read_from_a_ledger_alone_and_nothing_is_written(tmp_path, capsys):
    def memo(path) -> tuple[int, str]:
        with pytest.raises(SystemExit) as ended:
            main(["budget", str(path)])
        told = capsys.readouterr()
        return int(ended.value.code or 0), told.out + told.err

    ledger = Ledger(tmp_path / "study.ledger")
    ledger.end(ledger.begin("one", "plan", "m", 5, lambda spent: None), Usage(5, 2, 0.25))
    before = ledger.path.read_bytes()
    code, told = memo(ledger.path)
    assert code == 0 and "one" in told and "0.2500" in told and ledger.path.read_bytes() == before
    other = tmp_path / "book.db"
    with sqlite3.connect(other) as connection:
        connection.execute("CREATE TABLE entries (id INTEGER)")
    before = other.read_bytes()
    code, told = memo(other)
    assert code == 1 and "book.db" in told and "not a ledger" in told and other.read_bytes() == before
    assert memo(tmp_path) == (
        2,
        f"memo: LEDGER: {tmp_path} is a folder; expected the file that run.study_ledger names\n",
    )
