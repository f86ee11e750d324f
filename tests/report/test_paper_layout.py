"""A report has people, rounds and the skillbook's size as the paper reports them."""

from __future__ import annotations

from pathlib import Path

import attrs

from memo_core.report.findings import Findings
from memo_core.report.paper_layout import FILMS, consolidation, contents, people, rounds
from memo_core.report.tables import said_by_the_paper
from memo_core.study.journal import Journal, StudySession, TaughtRun

NOTHING = Findings(Path(), "offline", "tabletop", "language backend: offline", {}, {}, (), (), {}, (), (), (), (), {})


def journal(*runs: tuple[int, str, bool], consent: str = "a1b2") -> Journal:
    """Runs as (session, task, whether the session's end cut it short); every session has its own participant."""
    made = Journal(Path("study/history-0"))
    for number, (session, task, cut) in enumerate(runs, start=1):
        if session > len(made.sessions):
            made.sessions.append(StudySession(session, f"P{session:02d}", consent))
        end = {"active_s": 600.0, "session_over": cut, "corrections": 2, "planning_remarks": 1}
        made.runs.append(TaughtRun(number, session, f"P{session:02d}", task, number, end))
    return made


TWO_ROUNDS = ((1, "a", False), (1, "b", True), (2, "b", False), (2, "c", False), (3, "a", False), (3, "b", False))


def of_people(told: dict, consent: str = "a1b2") -> dict[str, str]:
    study = journal(*((number, "a", False) for number in range(1, 1 + max(1, len(told)))), consent=consent)
    return {what: ours for what, _, ours in people(attrs.evolve(NOTHING, journals=(study,), people=told)).rows}


def test_people_are_counted_and_their_age_has_a_mean_and_a_deviation():
    told = {
        "P01": {"age": 22, "gender": "Female", "robots": "none", "language_models": "daily"},
        "P02": {"age": 30, "gender": "male", "robots": "none", "language_models": None},
        "P03": {"age": None, "gender": "female ", "robots": None, "language_models": "daily"},
    }
    ours = of_people(told)
    assert ours["participants"] == "3, 0 several times"
    assert ours["gender"] == "2 female, 1 male"
    assert ours["age, mean ± standard deviation"] == "26.0 ± 5.7 (2 answered)"
    assert ours["use of language models"] == "2 daily, 1 no answer"


def test_simulated_participants_are_no_people_who_gave_no_answer():
    ours = of_people({"P01": {"age": None, "gender": None}}, consent="simulated")
    assert ours == {
        "participants": "1 simulated, 0 several times",
        "gender": "-",
        "age, mean ± standard deviation": "-",
        "use of language models": "-",
        "experience with robots": "-",
    }


def test_a_task_that_a_session_cut_short_is_the_next_sessions_in_the_same_round():
    assert journal(*TWO_ROUNDS).rounds == (1, 1, 1, 1, 2, 2)


def test_sessions_are_counted_in_the_round_in_which_they_began():
    table = rounds(attrs.evolve(NOTHING, journals=(journal(*TWO_ROUNDS),)))
    found = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [one["participants, paper"] for one in found] == [13, 4]
    assert [(one["round"], one["sessions"], one["tasks begun"]) for one in found] == [(1, "2", "4"), (2, "1", "2")]
    assert [one["minutes"] for one in found] == ["40", "20"]


def book(method: str, history: int, entries: int, characters: int, ablation: str = "") -> dict:
    size = {"entries": entries, "characters": characters, "hours": 2.0, "taught_hours": 1.5}
    return size | {"method": method, "history": history, "ablation": ablation}


def test_each_histories_book_before_is_compared_with_its_own_after():
    books = (
        book("memo-c", 0, 10, 1000),
        book("memo", 0, 6, 500),
        book("memo", 0, 1, 1, ablation="nonsense"),
        book("memo-c", 1, 20, 3000),
        book("memo", 1, 12, 1500),
        book("memo-c", 2, 99, 9999),  # its book after is not made yet
    )
    [row] = consolidation(attrs.evolve(NOTHING, books=books)).rows
    assert row == ("2", "1.5", "15.0", "9.0", "2000", "1000", "50 %", 2)


def test_what_a_report_lacks_of_the_paper_is_said_with_how_to_get_it():
    rows = {row[0]: row[-1] for row in contents(NOTHING, ("paper", FILMS)).rows}
    assert rows["Fig. 3"] == "yes" and rows["Fig. 2"] == "memo study run"
    assert rows["Table II"] == "evaluation.corrected"


def test_every_table_and_figure_of_the_paper_is_on_the_list():
    named = [one["what"] for one in said_by_the_paper()["contents"]]
    assert [name for name in named if not name.startswith("Sec.")] == [
        "Table I",
        "Table II",
        *(f"Fig. {number}" for number in range(1, 6)),
    ]


def test_without_a_study_nobody_is_reported():
    assert not people(NOTHING).rows and not rounds(NOTHING).rows


def test_a_run_to_look_at_is_named():
    made = contents(attrs.evolve(NOTHING, journals=(journal((1, "a", False)),)), ())
    assert {row[2] for row in made.rows if row[0] in ("Fig. 1", "Fig. 2")} == {
        "memo report study/history-0/runs/0001-a"
    }
