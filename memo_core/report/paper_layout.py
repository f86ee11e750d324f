"""Tables in the paper's layout for what is no rate: who taught, in which round, how far the skillbook shrank, and where
each table and figure of the paper stands in a report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from statistics import mean, stdev
from typing import Any

from memo_core.report.findings import Findings
from memo_core.report.tables import Table, said_by_the_paper
from memo_core.study.journal import Journal

SIMULATED = "simulated"  # consent of a session that no person held
RUN_PAGES, FILMS = "run pages", "films"


def people(findings: Findings) -> Table:
    """Table of the people who taught, as the paper reports its participants."""
    said = said_by_the_paper()["people"]
    rows = [(what, said[name], ours) for what, name, ours in _people(findings)] if findings.journals else []
    note = "Answers are optional and counted as they were given; simulated participants are asked nothing."
    return Table("paper-people", "Participants beside the paper's", ("what", "paper", "ours"), tuple(rows), note)


def _people(findings: Findings) -> Iterator[tuple[str, str, str]]:
    sessions = [session for journal in findings.journals for session in journal.sessions]
    simulated = {session.participant for session in sessions if session.consent == SIMULATED}
    came = Counter(session.participant for session in sessions)
    told = [findings.people.get(who, {}) for who in came if who not in simulated]
    kinds = [f"{len(told)}" if told else "", f"{len(simulated)} simulated" if simulated else ""]
    several = sum(count > 1 for count in came.values())
    yield "participants", "participants", ", ".join([*filter(None, kinds), f"{several} several times"])
    yield "gender", "gender", _counted(one.get("gender") for one in told)
    yield "age, mean ± standard deviation", "age", _age([one["age"] for one in told if one.get("age") is not None])
    yield "use of language models", "language_models", _counted(one.get("language_models") for one in told)
    yield "experience with robots", "robots", _counted(one.get("robots") for one in told)


def _counted(answers: Iterable[str | None]) -> str:
    """``13 male, 7 female, 1 no answer``; ``-`` where nobody was asked."""
    counted = Counter((answer or "no answer").strip().lower() for answer in answers)
    ordered = sorted(counted.items(), key=lambda one: (one[0] == "no answer", -one[1], one[0]))
    return ", ".join(f"{count} {answer}" for answer, count in ordered) or "-"


def _age(years: list[int]) -> str:
    if not years:
        return "-"
    spread = f" ± {stdev(years):.1f}" if len(years) > 1 else ""
    return f"{mean(years):.1f}{spread} ({len(years)} answered)"


def rounds(findings: Findings) -> Table:
    """Sessions that each round took, as the paper reports participants by round."""
    said = said_by_the_paper()["people"]["sessions_by_round"]
    ours = [_by_round(journal) for journal in findings.journals]
    rows = []
    for number in sorted({number for history in ours for number in history}):
        of = [history[number] for history in ours if number in history]
        paper = said[number - 1] if number <= len(said) else "-"
        rows.append((number, paper, *(f"{mean(column):.3g}" for column in zip(*of, strict=True)), len(of)))
    columns = ("round", "participants, paper", "sessions", "participants", "tasks begun", "minutes", "histories")
    note = (
        "Means over histories. The paper counts participants, each of whom held one session; a session counts in the "
        "round in which it began."
    )
    return Table("paper-rounds", "Participants by round beside the paper's", columns, tuple(rows), note)


def _by_round(journal: Journal) -> dict[int, tuple[int, int, int, float]]:
    """Sessions, participants, runs and minutes of each round of a history."""
    began: dict[int, int] = {}
    for run, number in zip(journal.runs, journal.rounds, strict=True):
        began.setdefault(run.session, number)
    found = {}
    for number in dict.fromkeys(journal.rounds):
        sessions = [one for one in journal.sessions if began.get(one.number) == number]
        runs = [run for run, of in zip(journal.runs, journal.rounds, strict=True) if of == number]
        minutes = sum(run.end["active_s"] for run in runs if run.end is not None) / 60
        found[number] = (len(sessions), len({one.participant for one in sessions}), len(runs), minutes)
    return found


def consolidation(findings: Findings) -> Table:
    """Entries and characters of the skillbook before and after consolidation, by hours of teaching."""
    rows = []
    for hours in sorted({book["hours"] for book in findings.books}):
        pairs = [pair for pair in _pairs(findings) if pair[0]["hours"] == hours]
        if pairs:
            before, after = zip(*pairs, strict=True)
            taught = mean(book["taught_hours"] for book in before)
            rows.append((f"{hours:g}", f"{taught:.1f}", *_shrunk(before, after), len(pairs)))
    columns = ("hours", "taught", "entries before", "after", "characters before", "after", "smaller by", "histories")
    note = (
        "Means over histories. Before: memo-c; after: memo, of the same feedback. The paper promises neither more "
        "entries nor more characters in any cluster, and gives no figures. A function is an entry beside the calls "
        "that it leaves in place of templates. Taught: hours that there were; a book of more hours holds what there is."
    )
    return Table("consolidation", "Skillbook before and after consolidation", columns, tuple(rows), note)


def _pairs(findings: Findings) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Books of one history and hour, before and after."""
    of = {(book["history"], book["hours"], book["method"]): book for book in findings.books if not book["ablation"]}
    for (history, hours, method), before in of.items():
        after = of.get((history, hours, "memo"))
        if method == "memo-c" and after is not None:
            yield before, after


def _shrunk(before: Collection[dict[str, Any]], after: Collection[dict[str, Any]]) -> tuple[str, ...]:
    entries, characters = (
        [mean(book[name] for book in books) for books in (before, after)] for name in ("entries", "characters")
    )
    smaller = f"{100 * (1 - characters[1] / characters[0]):.0f} %" if characters[0] else "-"
    return (*(f"{count:.1f}" for count in entries), *(f"{count:.0f}" for count in characters), smaller)


def contents(findings: Findings, made: Collection[str]) -> Table:
    """List of the paper's tables and figures with their places in this report.

    Args:
        findings: what the experiment's folder holds.
        made: names of the report's tables and figures, and ``FILMS`` where there are films.

    Returns:
        One row for each; the last cell is ``yes``, or how to get what is missing.
    """
    taught = _a_taught_run(findings)
    there = {*made, *([RUN_PAGES] if taught else [])} - ({"paper-table-2"} if not findings.corrected() else set())
    rows = []
    for one in said_by_the_paper()["contents"]:
        where = ", ".join(f"memo report {taught}" if taught and name == RUN_PAGES else name for name in one["here"])
        rows.append((one["what"], one["shows"], where, "yes" if there.issuperset(one["here"]) else one["otherwise"]))
    columns = ("paper", "shows", "here", "in this report, or how to get it")
    note = "Here: names of tables and figures of this report, and commands. Figures are numbered as in the paper."
    return Table("paper-contents", "The paper's tables and figures in this report", columns, tuple(rows), note)


def _a_taught_run(findings: Findings) -> str:
    """The folder of a run that a person corrected, else of any; empty where there is none."""
    runs = [(journal, run) for journal in findings.journals for run in journal.runs if run.end is not None]
    corrected = [one for one in runs if one[1].end is not None and one[1].end["corrections"]]
    journal, run = next(iter(corrected or runs), (None, None))
    return "" if journal is None or run is None else f"study/{journal.folder.name}/{run.folder}"
