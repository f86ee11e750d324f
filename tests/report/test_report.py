"""A report shows what is in the table, says which backend made it, and keeps the paper's numbers apart."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from statistics import mean

import pytest
import yaml

from memo_core.errors import InvalidArgument
from memo_core.plugins.registry import Registry
from memo_core.report.films import wanted
from memo_core.report.tables import Table, said_by_the_paper
from memo_core.report.writing import write_report

BLANK = {
    "ablation": "",
    "number": 0,
    "given": "",
    "reason": "",
    "corrections": 0,
    "programs": 3,
    "served": 10,
    "irrelevant": 4,
    "failed_at": "",
    "why": "",
}


def trial(method, task, scene, success, history=0, hours=2.0, mode="zero-shot", **more):
    name = f"{method}-{task}-{scene}-{history}-{hours}-{mode}-{more.get('ablation', '')}"
    told = {"trial": name, "same_as": name, "method": method, "task": task, "scene": scene, "success": success}
    failed = {} if success else {"failed_at": f"OPEN({task})", "why": f"did not arrive: {scene} cm <away>"}
    return BLANK | told | {"history": history, "hours": hours, "mode": mode} | failed | more


def experiment(tmp_path: Path) -> Path:
    rows = [
        trial("memo", task, scene, hours > 0 and scene != 1, history, hours)
        for task in ("oven", "can")
        for scene in range(3)
        for history in range(2)
        for hours in (0.0, 2.0)
    ]
    rows += [trial("memo", "oven", scene, True, mode="corrected", corrections=2) for scene in range(3)]
    rows += [trial("memo-s", task, scene, False, None, None) for task in ("oven", "can") for scene in range(3)]
    rows += [trial("memo", "oven", scene, False, ablation="nonsense") for scene in range(3)]
    folder = tmp_path / "evaluation"
    folder.mkdir()
    (folder / "trials.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (folder / "config.yaml").write_text(
        yaml.safe_dump({"llm": {"backend": "offline"}, "suite": {"backend": "kitchen"}})
    )
    references = {"oven": {"reference": 3, "nothing": 0, "scenes": 3}}
    (folder / "references.json").write_text(json.dumps(references))
    return tmp_path


def cells(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "report" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def test_tables_say_what_the_trials_say(tmp_path):
    written = write_report(Registry(), experiment(tmp_path))
    second = {row["method"]: row for row in cells(tmp_path, "table-2-success")}
    assert second["memo"]["success zero-shot"].startswith("67 % (")
    assert second["memo"]["corrections until success"] == "2.00 (2.00 to 2.00)"
    assert second["memo-s"]["success zero-shot"].startswith("0 %")
    by_hours = {(row["method"], row["hours"]): row["success"] for row in cells(tmp_path, "figure-4-hours")}
    assert by_hours["memo", "0"].startswith("0 %") and by_hours["memo", "2"].startswith("67 %")
    floor = {row["task"]: row for row in cells(tmp_path, "floor-and-ceiling")}
    assert floor["oven"]["memo, largest book"].endswith("of 6") and floor["oven"]["memo, empty book"].endswith("of 6")
    assert floor["oven"]["memo-s"].endswith("of 3"), "never counted together with trials of an empty book"
    assert floor["oven"]["reference"] == "3 of 3" and floor["can"]["reference"] == "not measured"
    failed = cells(tmp_path, "failures")
    assert {(row["method"], row["trials"], row["why"]) for row in failed if row["task"] == "oven"} == {
        ("memo", "2", "did not arrive: # cm <away>"),
        ("memo-s", "3", "did not arrive: # cm <away>"),
    }
    assert cells(tmp_path, "retrieval")[0]["share"] == "40 %"
    assert [row["change"] for row in cells(tmp_path, "ablations")] == ["none", "nonsense"]
    assert written.missing == ""


def test_given_books_are_counted_beside_the_empty_one(tmp_path):
    done = {"empty": {"safe"}, "lessons": {"door", "lid"}}
    rows = [
        trial("memo", task, 0, task in done[book], None, None, given=book, attempts=1, robot_s=20.0)
        | {"first_programs": task == "lid", "lesson_needed": 2, "lesson_served": 2 * (book == "lessons")}
        for book in done
        for task in ("door", "lid", "safe")
    ]
    file = experiment(tmp_path) / "evaluation" / "trials.jsonl"
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    write_report(Registry(), tmp_path)
    empty, lessons = cells(tmp_path, "given-books")
    assert (empty["done"], lessons["done"]) == ("1 of 3 (6 to 79 %)", "2 of 3 (21 to 94 %)")
    assert lessons["by the first programs"] == "1 of 3 (6 to 79 %)"
    assert (empty["right lesson served"], lessons["right lesson served"]) == ("0 of 6", "6 of 6")
    assert lessons["robot s until success"] == "20.00"
    by_task = {row["task"]: row for row in cells(tmp_path, "given-books-by-task")}
    assert by_task["door"]["empty"] == "not done (3)" and by_task["door"]["lessons"] == "done (3 +)"
    [changed] = cells(tmp_path, "gained-and-lost")
    assert (changed["trials"], changed["gained"], changed["lost"], changed["lost in"]) == ("3", "2", "1", "safe (1)")


def test_what_a_taught_book_gains_is_counted_scene_by_scene(tmp_path):
    write_report(Registry(), experiment(tmp_path))
    [changed] = cells(tmp_path, "gained-and-lost")
    assert changed == {"book": "memo, 2 h", "trials": "12", "gained": "8", "lost": "0", "lost in": ""}


def test_the_page_is_one_file_with_its_figures_in_it_and_says_which_backend_made_it(tmp_path):
    page = write_report(Registry(), experiment(tmp_path)).page.read_text()
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)[^\"]*\"", page)
    assert page.count("data:image/svg+xml;base64,") >= 3
    assert "regression figures" in page and "Made with language backend: offline" in page
    assert "&lt;away&gt;" in page and "<away>" not in page
    assert 'name="viewport"' in page and "@media print" in page
    for name in ("figure-4-hours", "figure-5-tasks", "profiles"):
        assert "language backend: offline" in _words((tmp_path / "report" / f"{name}.svg").read_text())
        assert (tmp_path / "report" / f"{name}.png").read_bytes()[:4] == b"\x89PNG"


def test_no_legend_above_a_figure_reaches_into_its_title(tmp_path, monkeypatch):
    from matplotlib import pyplot

    drawn = []
    monkeypatch.setattr(pyplot, "close", drawn.append)
    write_report(Registry(), experiment(tmp_path))
    monkeypatch.undo()
    with_legend = [figure for figure in drawn if figure.axes[0].get_legend() is not None]
    assert len(with_legend) >= 3
    for figure in with_legend:
        [axes] = figure.axes
        legend, title = axes.get_legend().get_window_extent(), axes.get_title(loc="left")
        [text] = [one for one in axes.get_children() if getattr(one, "get_text", str)() == title]
        assert legend.y1 < text.get_window_extent().y0, title
    for figure in drawn:
        pyplot.close(figure)


def _words(svg: str) -> str:
    """matplotlib draws text as paths and leaves it in comments."""
    return " ".join(re.findall(r"<!-- (.*?) -->", svg))


def test_the_paper_s_numbers_agree_with_each_other_where_the_paper_s_do():
    said = said_by_the_paper()
    first, second = said["table_1"], said["table_2"]
    assert sum(row["feedback"] for row in first["training"]) == first["total"] == 224
    assert (len(first["training"]), len(first["held_out"])) == (20, 5)
    assert [row["task"] for row in second["tasks"]] == [row["task"] for row in first["held_out"]]
    for method, overall in second["overall"].items():
        columns = zip(*(row[method] for row in second["tasks"]), strict=True)
        assert [round(mean(column), 2) for column in columns] == overall, method
    assert {row["type"] for row in (*first["training"], *first["held_out"])} == {"LH", "CR", "SR", "TR"}
    assert all(row["where"] not in ("", "unknown") for row in (*said["figures"], *said["zero_shot"].values()))


def test_the_paper_s_tasks_are_those_of_its_suite():
    suite = {task.name: task for task in Registry().get("suite", "tabletop").factory(None)}
    said = said_by_the_paper()["table_1"]
    for split, rows in (("training", said["training"]), ("held-out", said["held_out"])):
        ours = {(name, task.kind) for name, task in suite.items() if task.split == split}
        assert {(row["task"].lower().replace(" ", "-"), row["type"]) for row in rows} == ours


def test_corrections_of_the_paper_are_shown_under_their_own_method(tmp_path):
    write_report(Registry(), experiment(tmp_path))
    feedback = {row["method"]: row["feedback a task, paper"] for row in cells(tmp_path, "paper-methods")}
    assert feedback == {"memo": "1.52", "memo-c": "2.2", "droc-v": "2.76", "pi0.5": "-", "memo-s": "-"}
    methods = {row["method"]: row for row in cells(tmp_path, "paper-methods")}
    assert methods["memo"]["zero-shot, paper (simulation)"] == "78 %"
    assert methods["droc-v"]["zero-shot, paper (simulation)"] == "28 % or 40 %"
    assert methods["memo-c"]["zero-shot, paper (simulation)"] == "-", "the text does not say which method has 42 %"
    assert methods["memo"]["zero-shot, ours"] == "67 % (33 to 100) of 12"
    assert methods["memo"]["corrections a trial, ours"] == "2"
    said = {row["what"]: row for row in cells(tmp_path, "paper")}
    assert said["zero-shot success of droc-v"]["paper"] == "28 % or 40 %"
    assert said["pieces of feedback a task with memo-c"]["paper"] == "2.2 or 2.76"
    assert said["zero-shot success with an empty skillbook"]["ours"].startswith("0 % (0 to 0) of 12")
    assert said["zero-shot success of memo with the full skillbook"]["ours"].startswith("67 % (")
    assert said["improvement of zero-shot success by clustering"]["ours"] == "-", "there is no memo-c"


def test_each_task_has_the_paper_s_success_and_corrections_above_ours(tmp_path):
    file = experiment(tmp_path) / "evaluation" / "trials.jsonl"
    oven = "put-the-food-in-the-oven"
    rows = [trial("memo", oven, scene, scene > 0, mode="corrected", corrections=scene) for scene in range(4)]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    write_report(Registry(), tmp_path)
    told = {(row["task"], row["whose"]): row for row in cells(tmp_path, "paper-table-2")}
    paper = told[oven, "paper"]
    assert [paper[one] for one in ("memo", "memo-c", "droc-v", "pi0.5")] == ["60 (3.4)", "40 (4)", "20 (4.6)", "20"]
    assert (told[oven, "ours"]["memo"], told[oven, "ours"]["droc-v"]) == ("75 (1.5)", "-")
    assert [told["all", "paper"][one] for one in ("memo", "memo-c", "droc-v")] == ["88 (1.52)", "84 (2.2)", "60 (2.76)"]
    assert ("pour-the-can", "ours") not in told, "nobody corrected there"
    page = (tmp_path / "report" / "index.html").read_text()
    assert page.count("says nothing about the methods") == 4, "beside each of the tables"
    first = {row["task"]: row for row in cells(tmp_path, "paper-table-1")}
    assert first["season-the-food"]["feedback, paper"] == "37" and first["all"]["feedback, paper"] == "224"


def test_the_project_names_the_paper_and_its_authors():
    said, root = said_by_the_paper(), Path(__file__).parents[2]
    [cited] = yaml.safe_load((root / "CITATION.cff").read_text())["references"]
    assert cited["title"] == said["title"]
    assert [f"{one['given-names']} {one['family-names']}" for one in cited["authors"]] == said["authors"]
    for page in ("README.md", "docs/index.md"):
        words = " ".join((root / page).read_text().split())
        assert said["title"] in words and all(author in words for author in said["authors"]), page
        assert said["source"].removeprefix("arXiv ") in words, page


def test_what_is_filmed_is_a_success_and_a_failure_of_each_method_and_task_where_there_is_one(tmp_path):
    lines = (experiment(tmp_path) / "evaluation" / "trials.jsonl").read_text().splitlines()
    chosen = [(row["method"], row["task"], row["success"]) for row in wanted([json.loads(line) for line in lines])]
    both = [("memo", task, success) for task in ("oven", "can") for success in (False, True)]
    assert sorted(chosen) == sorted([*both, ("memo-s", "can", False), ("memo-s", "oven", False)])


def test_cells_of_markdown_do_not_break_its_table():
    table = Table("t", "Title", ("a", "b"), (("x|y", None),))
    assert "| x\\|y |  |" in table.markdown()


def test_a_folder_without_an_experiment_is_refused(tmp_path):
    with pytest.raises(InvalidArgument, match="neither a study nor an evaluation nor a run"):
        write_report(Registry(), tmp_path)


def test_a_report_of_an_evaluation_that_was_refused_says_that_it_is_empty(tmp_path):
    settings = {"llm": {"backend": "offline"}, "suite": {"backend": "tabletop"}}
    (tmp_path / "evaluation").mkdir()
    (tmp_path / "evaluation" / "config.yaml").write_text(yaml.safe_dump(settings))
    assert "holds no trial and no taught run yet" in write_report(Registry(), tmp_path).missing
