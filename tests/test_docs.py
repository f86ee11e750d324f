"""The documentation's code runs."""

from __future__ import annotations

import importlib
import importlib.util
import json
import pkgutil
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from memo_core.events import FeedbackGiven, Problem
from memo_core.interfaces.backend import Backend
from memo_core.plugins import hooks

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "plugins").glob("*.md"))
OVERVIEW = ROOT / "docs" / "plugins" / "README.md"
WITH_CODE = [page for page in PAGES if page != OVERVIEW and "@hookimpl" in page.read_text(encoding="utf-8")]


def plugin_of(page: Path) -> dict:
    namespace: dict = {"__name__": f"page_{page.stem}"}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, page.name, "exec"), namespace)
    return namespace


def backends_of(namespace: dict) -> list[Backend]:
    found: list[Backend] = []
    for name, value in namespace.items():
        if name.startswith("memo_") and hasattr(hooks, name):
            found += value()
    return found


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_the_plugin_on_a_page_declares_a_backend_of_that_kind(page):
    [backend] = backends_of(plugin_of(page))
    assert backend.kind == page.stem
    backend.config()
    assert backend.summary


def test_the_overview_declares_a_backend_and_hears_what_people_say(capsys):
    made = plugin_of(OVERVIEW)
    listener = made.pop("memo_event")
    [backend] = backends_of(made)
    assert backend.kind == "perception" and backend.config().resolution == 640
    assert backend.needs.secrets == ("CAMERA_TOKEN",)
    listener(FeedbackGiven(1, "P01", "OPEN(door)", "the door opens to the left"))
    listener(Problem("here", "nothing said"))
    assert capsys.readouterr().out == "P01 said: the door opens to the left\n"


def test_the_command_on_its_page_works():
    from typer.testing import CliRunner

    page = next(page for page in PAGES if page.stem == "command")
    ran = CliRunner().invoke(plugin_of(page)["app"], [])
    assert ran.exit_code == 0 and "robots" in ran.output


def test_every_kind_has_its_page():
    from memo_core.interfaces.backend import KINDS

    assert {page.stem for page in PAGES} >= set(KINDS)


def test_the_pages_backends_do_what_they_say():
    made = {page.stem: plugin_of(page) for page in WITH_CODE}

    def build(kind):
        [backend] = backends_of(made[kind])
        return backend.factory(backend.config())

    embedder = build("embedder")
    vectors = embedder.embed(["open the door", "open the lid", "yodel"])
    assert (
        np.allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-5) and vectors[0] @ vectors[1] > vectors[0] @ vectors[2]
    )
    store = build("vectorstore")
    store.add([7, 9, 11], vectors)
    assert store.search(vectors[0], 2)[0].tolist() == [7, 9]
    for kind in ("robot_driver", "gripper_driver"):
        rules = importlib.import_module(f"memo_core.testing.{kind}").RULES
        for check in rules.values():
            check(lambda kind=kind: build(kind))
    robot = build("robot")
    pinocchio = pytest.importorskip("pinocchio")
    moving = len(robot.joints) + len(robot.gripper.finger_joints)
    assert pinocchio.buildModelFromXML(robot.urdf).nq == moving
    [task] = build("suite")
    assert task.scene(np.random.default_rng(0)).body("block").label == "block"
    [nudge] = build("skills")
    assert nudge.signature == "nudge_up(height: float = 0.05) -> None"


def documented() -> set[int]:
    """Identities of the objects that the reference documents: those it names, and the public names of its modules."""
    found: set[int] = set()
    for page in (ROOT / "docs" / "reference").glob("*.md"):
        for path in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE):
            value = pkgutil.resolve_name(path)
            inside = vars(value) if isinstance(value, ModuleType) else {path: value}
            found |= {id(item) for name, item in inside.items() if not name.startswith("_")}
    return found


def test_the_reference_documents_every_public_name():
    import memo_core

    packages = [f"memo_core.{found.name}" for found in pkgutil.iter_modules(memo_core.__path__) if found.ispkg]
    known, missing = documented(), []
    for module in ("memo_core", "memo_core.plugin", *packages):
        public = importlib.import_module(module)
        names = getattr(public, "__all__", ())
        missing += [f"{module}.{name}" for name in names if id(getattr(public, name)) not in known]
    assert not missing, "these belong on a page of docs/reference, as `::: NAME`"


def test_files_that_the_docs_name_exist():
    """Links are checked by mkdocs; this is about names in the text."""
    named = re.compile(r"`((?:memo_core|tests|plugins|benchmarks|docs|examples|tools)/[\w./-]+\.(?:py|toml|yaml|md))`")
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found = [(page.name, path) for page in pages for path in named.findall(page.read_text(encoding="utf-8"))]
    assert len(found) > 30
    assert not [(page, path) for page, path in found if not (ROOT / path).exists()]


def tables():
    """``tools/tables.py``, which is no package."""
    spec = importlib.util.spec_from_file_location("docs_tables", ROOT / "tools" / "tables.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tables_of_measured_figures_are_those_of_their_files():
    assert [page.name for page in tables().outdated()] == [], "run python tools/tables.py"


def test_every_file_of_measured_figures_is_shown():
    shown = {
        name
        for page in tables().pages()
        for name in re.findall(r"<!-- table: (results/\S+) -->", page.read_text("utf-8"))
    }
    assert shown == {f"results/{path.name}" for path in (ROOT / "results").glob("*.json")}


def test_a_table_that_was_edited_by_hand_is_noticed_and_written_again(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "results").mkdir()
    result = {"command": "memo bench stop", "note": "", "rows": [{"phase": "moving", "ms": 3}]}
    (tmp_path / "results" / "stop.json").write_text(json.dumps(result), encoding="utf-8")
    (tmp_path / "README.md").write_text("none\n", encoding="utf-8")
    page = tmp_path / "docs" / "page.md"
    page.write_text("A\n<!-- table: results/stop.json -->\n| ms |\n<!-- /table -->\nB\n", encoding="utf-8")
    [(found, text)] = tables().outdated(tmp_path).items()
    assert found == page and "| moving | 3 |" in text and text.startswith("A\n") and text.endswith("\nB\n")
    page.write_text(text, encoding="utf-8")
    assert tables().outdated(tmp_path) == {}


def test_a_result_file_with_uneven_rows_is_refused_by_name(tmp_path):
    path = tmp_path / "stop.json"
    path.write_text('{"command": "c", "note": "", "rows": [{"a": 1}, {"b": 2}]}', encoding="utf-8")
    made = tables()
    with pytest.raises(made.TableError, match=r"stop\.json: row 2 has the headings"):
        made.markdown(path)


def test_the_code_that_the_page_on_the_paper_names_exists():
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    names = set(re.findall(r"`(memo_\w+(?:\.\w+)+)`", page))
    assert len(names) > 15
    for name in names:
        pkgutil.resolve_name(name)
