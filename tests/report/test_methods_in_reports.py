"""Methods that cannot do something have "–" there; what has a skillbook and what has none is never averaged together;
every rate says its trials, interval and backends; a suite that separates nothing is warned of."""

from __future__ import annotations

import csv
import itertools
import json
import re
from pathlib import Path

import pytest
import yaml

from memo_core.errors import InvalidArgument
from memo_core.evaluation.table import has_memory, outcomes
from memo_core.plugins.registry import Registry
from memo_core.report import beside_the_paper, figures, tables
from memo_core.report.findings import gather
from memo_core.report.made_with import made_with
from memo_core.report.separation import warnings_of
from memo_core.report.statistics import Outcomes, poolable
from memo_core.report.writing import write_report

BLANK = {
    "ablation": "",
    "number": 0,
    "given": "",
    "reason": "",
    "corrections": 1,
    "programs": 3,
    "served": 10,
    "irrelevant": 4,
    "failed_at": "",
    "why": "",
}
SETTINGS = {
    "llm": {"backend": "litellm", "model": "lab/large"},
    "suite": {"backend": "kitchen"},
    "simulator": {"backend": "mujoco"},
    "perception": {"backend": "ground-truth"},
    "robot": {"backend": "panda", "driver": {"backend": "simulated"}},
    "evaluation": {"methods": [{"backend": "memo"}, {"backend": "policy", "checkpoint": "base", "steps": 5}]},
}
SUCCESSES = {"memo": (1, 1, 0), "memo-s": (1, 0, 0), "policy": (0, 0, 1)}


def trial(method, task, scene, success, **more):
    memory = method == "memo"
    where = {"history": 0, "hours": 2.0} if memory else {"history": None, "hours": None}
    told = {"method": method, "task": task, "scene": scene, "success": bool(success), "mode": "zero-shot"}
    able = {"memory": memory, "takes_feedback": method != "policy"}
    made = BLANK | told | where | able | ({} if memory else {"served": 0, "irrelevant": 0}) | more
    made |= {"programs": 0} if method == "policy" else {}
    name = "-".join(str(made[part]) for part in ("method", "task", "scene", "history", "hours", "mode", "given"))
    return made | {"trial": name, "same_as": name}


def experiment(folder: Path, successes=SUCCESSES, settings=SETTINGS) -> Path:
    rows = [
        trial(method, task, scene, success, mode=mode)
        for method, outcomes in successes.items()
        for mode in ("zero-shot", "corrected")
        for task in ("oven", "can")
        for scene, success in enumerate(outcomes)
        if (method, mode) != ("policy", "corrected")
    ]
    rows += [trial("memo", "oven", scene, False, hours=0.0) for scene in range(3)]
    (folder / "evaluation").mkdir(parents=True)
    (folder / "evaluation" / "trials.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (folder / "evaluation" / "config.yaml").write_text(yaml.safe_dump(settings))
    book = {"hours": 2.0, "method": "memo", "ablation": "", "clustering": "at-the-end", "entries": 3, "characters": 90}
    (folder / "books" / "history-0").mkdir(parents=True)
    (folder / "books" / "history-0" / "memo-h2.json").write_text(json.dumps(book | {"history": 0}))
    return folder


def cells(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "report" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_method_has_a_dash_where_it_declares_that_it_cannot(tmp_path):
    write_report(Registry(), experiment(tmp_path))
    second = {row["method"]: row for row in cells(tmp_path, "table-2-success")}
    assert set(second) == {"memo", "memo-s", "policy"}
    for column in ("hours", "success with corrections", "corrections a trial", "programs zero-shot", "watched"):
        assert second["policy"][column] == "–", column
    assert second["policy"]["success zero-shot"].endswith("of 6")
    assert (second["memo-s"]["hours"], second["memo-s"]["watched"]) == ("–", "6")
    assert "–" not in second["memo"].values()
    for name, method_column in (("retrieval", 4), ("books", 8)):
        rows = {row["method"]: list(row.values()) for row in cells(tmp_path, name)}
        assert set(rows) == {"memo", "memo-s", "policy"}, name
        assert rows["policy"].count("–") == rows["memo-s"].count("–") >= method_column, name
        assert "–" not in rows["memo"], name


def test_rows_with_and_without_a_skillbook_are_refused_where_rows_are_averaged():
    rows = [trial("memo", "oven", 0, True), trial("memo-s", "oven", 0, False)]
    former = [{key: row[key] for key in row if key != "memory"} for row in rows]
    assert [has_memory(row) for row in former] == [has_memory(row) for row in rows] == [True, False]
    assert has_memory(trial("memo", "oven", 0, True, memory=True, history=None, hours=None, given="empty"))
    for mixed in (rows, former):
        for averaging in (poolable, Outcomes.of, tables.rate_of, lambda rows: beside_the_paper._mean(rows, "success")):
            with pytest.raises(InvalidArgument, match="never averaged together"):
                averaging(mixed)


def test_no_table_or_figure_averages_rows_with_a_skillbook_and_rows_without(tmp_path, monkeypatch):
    averaged = []

    def recorded(rows):
        listed = list(rows)
        averaged.append({has_memory(row) for row in listed})
        return listed

    monkeypatch.setattr("memo_core.report.statistics.poolable", recorded)
    monkeypatch.setattr(beside_the_paper, "poolable", recorded)
    experiment(tmp_path)
    write_report(Registry(), tmp_path)
    assert len(averaged) > 20 and all(len(kinds) <= 1 for kinds in averaged)
    assert {True} in averaged and {False} in averaged
    counted = [row for row in cells(tmp_path, "floor-and-ceiling") if row["task"] == "oven"]
    assert [(row["memo-s"][-4:], row["memo, empty book"][-4:]) for row in counted] == [("of 3", "of 3")]


def test_what_a_command_counts_is_by_method_skillbook_and_mode():
    rows = [trial("memo", "oven", 0, True), trial("memo", "can", 0, False), trial("policy", "oven", 0, True)]
    counted = {(one["method"], one["skillbook"]): (one["successes"], one["trials"]) for one in outcomes(rows)}
    assert counted == {("memo", "2 h"): (1, 2), ("policy", ""): (1, 1)}


def test_every_rate_comes_with_its_interval_its_trials_and_what_it_was_made_with(tmp_path):
    page = write_report(Registry(), experiment(tmp_path)).page.read_text(encoding="utf-8")
    made = "language backend: litellm (lab/large); simulator: mujoco; perception: ground-truth; suite: kitchen"
    findings = gather(Registry(), tmp_path)
    assert findings.made_with == made
    assert "Settings of policy: checkpoint: base, steps: 5." in page
    rate = re.compile(r"\d+ %")
    whole = re.compile(r"^\d+ % \(\d+ to \d+\) of \d+$")
    markdown = (tmp_path / "report" / "tables.md").read_text(encoding="utf-8")
    for title in (table.title for table in tables.all_tables(findings)):
        section = markdown.split(f"## {title}\n")[1].split("\n## ")[0]
        assert f"Made with {made}." in section, title
    for name in ("table-2-success", "figure-4-hours", "figure-5-tasks", "floor-and-ceiling"):
        shown = [cell for row in cells(tmp_path, name) for cell in row.values() if rate.search(cell)]
        assert shown and all(whole.match(cell) for cell in shown), name
    for name in ("figure-4-hours", "figure-5-tasks", "profiles"):
        drawn = re.findall(r"<!-- (.*?) -->", (tmp_path / "report" / f"{name}.svg").read_text(encoding="utf-8"))
        assert made in drawn and "policy (6 trials)" in drawn, name


def test_methods_of_plugins_have_colours_of_their_own(tmp_path):
    findings = gather(Registry(), experiment(tmp_path, SUCCESSES | {"vla": (0, 1, 0), "reader": (1, 1, 1)}))
    colours = [figures._colour(findings, method) for method in findings.methods]
    assert len(set(colours)) == len(colours)


@pytest.mark.parametrize(
    ("memo", "policy", "said"),
    [
        ((0, 0, 0), (0, 0, 0), "zero-shot: the suite is at its floor (memo 0 % (0 to 0) of 6; policy 0 %"),
        ((1, 1, 1), (1, 1, 1), "zero-shot: the suite is at its ceiling"),
        ((1, 1, 1), (0, 0, 0), ""),
        ((1, 1, 0), (1, 1, 1), ""),
    ],
)
def test_a_suite_at_its_floor_or_ceiling_for_all_methods_is_warned_of(tmp_path, memo, policy, said):
    folder = experiment(tmp_path, {"memo": memo, "policy": policy})
    page = write_report(Registry(), folder).page.read_text(encoding="utf-8")
    warnings = warnings_of(gather(Registry(), folder))
    assert len(warnings) == bool(said) and all(line.startswith(said) for line in warnings)
    assert all("at most 5 %, or in at least 95 %" in line and line in page for line in warnings)
    assert page.count('<p class="warning">') == len(warnings)


def test_tasks_at_their_ceiling_are_named_though_the_suite_is_not_and_one_method_is_never_warned_of(tmp_path):
    folder = experiment(tmp_path / "two", {"memo": (1, 1, 1), "policy": (1, 1, 1)})
    file = folder / "evaluation" / "trials.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    lost = [row | {"success": row["success"] and row["task"] == "oven"} for row in rows if row["method"] == "policy"]
    mixed = [*(row for row in rows if row["method"] == "memo"), *lost]
    file.write_text("".join(json.dumps(row) + "\n" for row in mixed))
    [line] = warnings_of(gather(Registry(), folder))
    assert line.startswith("zero-shot: at ceiling for all methods, and separating none of them: oven.")
    alone = experiment(tmp_path / "one", {"memo": (1, 1, 1)})
    assert warnings_of(gather(Registry(), alone)) == []


def test_a_real_robot_is_named_in_place_of_the_simulator(tmp_path):
    robot = {"backend": "fr3", "driver": {"backend": "franka"}}
    findings = gather(Registry(), experiment(tmp_path, settings=SETTINGS | {"robot": robot}))
    assert "robot driver: franka" in findings.made_with and "simulator" not in findings.made_with
    assert list(itertools.chain(findings.method_settings)) == ["policy"]


def test_a_method_that_only_one_book_was_given_stands_beside_the_others(tmp_path):
    folder = experiment(tmp_path, {"policy": (0, 0, 1)})
    table = folder / "evaluation" / "trials.jsonl"
    given = [
        trial("memo", task, scene, True) | {"given": "empty", "attempts": 1, "robot_s": 9.0}
        for task in ("oven", "can")
        for scene in range(3)
    ]
    policy = [line for line in table.read_text().splitlines() if json.loads(line)["method"] == "policy"]
    table.write_text("".join(line + "\n" for line in (*map(json.dumps, given), *policy)))
    write_report(Registry(), folder)
    [memo, other] = cells(folder, "table-2-success")
    assert memo["hours"] == "empty" and memo["success zero-shot"].startswith("100 %") and other["hours"] == "–"
    by_task = {row["task"]: row for row in cells(folder, "figure-5-tasks")}
    assert by_task["oven"]["memo"].startswith("100 %") and by_task["oven"]["policy"].startswith("33 %")


def test_the_model_that_looks_is_named_beside_the_one_that_plans():
    settings = {
        "llm": {"backend": "offline"},
        "perception": {"backend": "cameras", "llm": {"backend": "litellm", "model": "g/er"}},
    }
    assert made_with(settings) == (
        "language backend: offline; perception: cameras; model of perception: litellm (g/er)"
    )
