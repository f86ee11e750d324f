"""Templates and calls are run again from the start that the run stored and in fresh scenes, and what was measured stays
with them; what has no start is told and is no trial."""

from __future__ import annotations

import json
import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest
from memo_sim_mujoco.simulator import MujocoSimulator, SimulationDiverged

from memo_core.cli.main import main
from memo_core.maintenance.retesting import Planned, Retesting
from memo_core.maintenance.template_sources import CannotRetest, program_of, start_of
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_history import History, LogEntry as Effect
from memo_core.skillbook import track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import store
from memo_core.skillbook.history import roll_back
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import GeneralFunction
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.writing.functions import GroupChange
from tests.support.cluster_books import approve
from tests.support.taught_book import FAILING, GRASP, PICK, teach


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def taught(registry, tmp_path_factory) -> Path:
    """A folder with a book, ``book.db``, and the run that taught it a template."""
    folder = tmp_path_factory.mktemp("taught")
    teach(registry, folder)
    return folder


@pytest.fixture
def book(taught, tmp_path):
    shutil.copy(taught / "book.db", tmp_path / "book.db")
    with Skillbook(str(tmp_path / "book.db")) as opened:
        yield opened


@pytest.mark.sim
def test_a_template_is_run_from_its_stored_start_and_in_a_fresh_scene(book, registry):
    [template] = book.entries("template")
    retesting = Retesting(book, registry)
    first, second = retesting.plan([template], [0, 3])  # the run's own seed is no fresh one
    assert isinstance(first, Planned) and first.seed is None and first.start.startswith("run put-the-cube-away")
    assert isinstance(second, Planned) and second.start == "put-the-cube-away seed 3"
    assert [retesting.run(one).success for one in (first, second)] == [True, True]
    kept = track_record.trials_of(book)[template.id]
    assert [(one.start, one.success) for one in kept] == [(first.start, True), (second.start, True)]


@pytest.mark.sim
def test_one_that_fails_is_measured_so_and_an_edited_one_has_the_start_of_the_version_before(book, registry):
    [template] = book.entries("template")
    edited = book.edit(template.id, FAILING, "ana")
    retesting = Retesting(book, registry)
    [planned] = retesting.plan([edited], [])
    found = retesting.run(planned)
    assert found.success is False and found.reason
    [trial] = track_record.trials_of(book, [edited.id])[edited.id]
    assert not trial.success and trial.reason == found.reason


@pytest.mark.sim
def test_a_stop_keeps_nothing_of_the_trial_and_all_of_those_before(book, registry):
    [template] = book.entries("template")
    track_record.note_trial(book, template.id, "elsewhere", True)

    @contextmanager
    def stopping(link):
        link.stop()
        yield

    retesting = Retesting(book, registry, stopping)
    [planned] = retesting.plan([template], [])
    with pytest.raises(KeyboardInterrupt):
        retesting.run(planned)
    assert [one.start for one in track_record.trials_of(book)[template.id]] == ["elsewhere"]
    assert not book.problems()


@pytest.mark.sim
def test_what_the_simulator_could_not_carry_out_is_no_trial(book, registry, monkeypatch):
    def broken(self, targets):
        raise SimulationDiverged(1.0, "BADQACC")

    retesting = Retesting(book, registry)
    [planned] = retesting.plan(book.entries("template"), [])
    monkeypatch.setattr(MujocoSimulator, "command_joints", broken)
    found = retesting.run(planned)
    assert found.success is None and "diverged" in found.reason and found.error is not None
    assert not track_record.trials_of(book)


# -- calls of functions --------------------------------------------------------------------------------------------


def lifts(body: str = GRASP) -> str:
    return f'def lift(thing):\n    """Grasp a thing from above and lift it."""{body}'


def generalise(book: Skillbook, code: str) -> Entry:
    """Make a function of the template that was taught and of one without a run; the call for the cube."""
    [template] = book.entries("template")
    other = approve(book, "LIFT(ball)", PICK)
    store(book, GroupChange((GeneralFunction(code, ((template.id, "lift('cube')"), (other, "lift('ball')"))),)))
    return next(call for call in book.entries("call") if str(call.key) == "LIFT(cube)")


@pytest.mark.sim
def test_a_call_is_run_from_the_start_of_the_template_that_it_stands_in_for(book, registry):
    call = generalise(book, lifts())
    retesting = Retesting(book, registry)
    first, second = retesting.plan([call], [3])
    assert isinstance(first, Planned) and first.start.startswith("run put-the-cube-away")
    assert program_of(first.template) == lifts().replace("(thing)", "(thing='cube')", 1).rstrip() + "\n\n\nlift()\n"
    assert [retesting.run(one).success for one in (first, second)] == [True, True]
    kept = track_record.trials_of(book)[call.id]
    assert [(one.start, one.success) for one in kept] == [(first.start, True), (second.start, True)]


@pytest.mark.sim
def test_a_call_that_fails_gives_way_to_the_template_that_it_stood_in_for(book, registry):
    [template] = book.entries("template")
    call = generalise(book, lifts("\n    look()\n"))
    retesting = Retesting(book, registry)
    [planned] = retesting.plan([call], [])
    assert retesting.run(planned).success is False
    assert [one.id for one in book.entries("template")] == [template.id]
    assert [str(one.key) for one in book.entries("call")] == ["LIFT(ball)"] and not book.problems()


@pytest.mark.sim
def test_a_call_of_an_edited_function_is_run_with_the_version_there_is(book, registry):
    call = generalise(book, lifts("\n    look()\n"))
    [function] = book.entries("function")
    edited = book.edit(function.id, lifts(), "ana")
    retesting = Retesting(book, registry)
    [planned] = retesting.plan([call], [])
    assert retesting.run(planned).success
    roll_back(book, edited.revision)
    [planned] = Retesting(book, registry).plan([call], [])
    assert "close_gripper" not in planned.template.text, "the version that is active again"


def test_a_call_that_was_approved_as_one_has_the_start_of_its_own_approval(book, registry, monkeypatch):
    generalise(book, lifts())
    [function] = book.entries("function")
    approval = book.record_feedback("", "ana", subtask="LIFT(mug)", kind="approval", run="gone")
    call = book.add_call(approval, "LIFT(mug)", "lift('mug')", function.id)
    [told] = Retesting(book, registry).plan([call], [])
    assert told.success is None and "the folder of the run gone is not here" in told.reason


@pytest.mark.sim
def test_the_command_retests_calls_as_well(taught, tmp_path, capsys):
    path = tmp_path / "book.db"
    shutil.copy(taught / "book.db", path)
    with Skillbook(str(path)) as book:
        call = generalise(book, lifts())
        [function] = book.entries("function")

    def retest(*more: str):
        with pytest.raises(SystemExit) as ended:
            main(["skillbook", "retest", "--book", str(path), "--seeds", "4", *more])
        out, err = capsys.readouterr()
        return ended.value.code, out, err

    code, out, err = retest("--json")
    cube, ball = json.loads(out)["templates"]
    assert (not code, cube["template"], cube["kind"], cube["key"], cube["successes"]) == (
        True,
        call.id,
        "call",
        "LIFT(cube)",
        2,
    ), err
    assert ball["trials"] == 0 and "not approved in a run" in json.loads(out)["not_run"][0]["reason"]
    code, out, _ = retest(str(call.id))
    assert not code and "call" in out and "2/2" in out
    code, _, err = retest(str(function.id))
    assert code and f"entry {function.id} is no template and no call" in err


def test_a_template_without_a_run_or_without_its_folder_is_told_and_is_no_trial(book, registry, monkeypatch):
    monkeypatch.setattr(Skillbook, "places", lambda self: [])
    key = "OPEN(box)"
    alone = book.add_template(book.record_feedback("", "ana", subtask=key, kind="approval"), key, FAILING)
    told = list(Retesting(book, registry).plan(book.entries("template"), [1]))
    assert [one.success for one in told] == [None, None]
    assert "folder of the run put-the-cube-away" in told[0].reason and "not approved in a run" in told[1].reason
    assert told[1].template == alone.id and not track_record.trials_of(book)


@pytest.mark.sim
def test_the_command_tells_keeps_and_goes_on(taught, tmp_path, capsys):
    shutil.copy(taught / "book.db", tmp_path / "book.db")

    def retest(*more: str):
        with pytest.raises(SystemExit) as ended:
            main(["skillbook", "retest", "--book", str(tmp_path / "book.db"), "--seeds", "4", *more])
        out, err = capsys.readouterr()
        assert not ended.value.code, err
        return out, err

    out, _ = retest("--json")
    [row] = json.loads(out)["templates"]
    assert (row["key"], row["trials"], row["successes"], row["fails"]) == ("LIFT(cube)", 2, 2, False)
    out, err = retest()
    assert "2 of 2 trials are in the book already" in err and "2/2" in out


def test_hardware_is_refused_in_one_sentence(taught, capsys, monkeypatch):
    from memo_core.maintenance import retesting

    class Moves:
        simulated = False

    monkeypatch.setattr("memo_core.config.Experiment.create", lambda self, kind, *_, **__: Moves())
    monkeypatch.setattr(retesting.Retesting, "plan", lambda *_: pytest.fail("nothing may be run"))
    with pytest.raises(SystemExit) as ended:
        main(["skillbook", "retest", "--book", str(taught / "book.db")])
    err = capsys.readouterr().err
    assert ended.value.code and "retest runs templates in simulators only" in err and err.count("\n") == 1


# -- starts and calls ----------------------------------------------------------------------------------------------


def history(*effects: tuple[str, str, str]) -> History:
    import base64
    import zlib

    def value(world: str) -> dict[str, str]:
        return {"world": base64.b85encode(zlib.compress(world.encode())).decode()} if world else {}

    made = [Effect(n, name, about, ended=True, value=value(world)) for n, (name, about, world) in enumerate(effects)]
    return History({}, tuple(made))


PLAN, RAN = ("ask a model", "plan 1f", ""), ("execute", "9", "after")


def saved(world: str) -> tuple[str, str, str]:
    return "checkpoint", "", world


def kept(approval: int) -> tuple[str, str, str]:
    return "add a template", f"approval {approval}", ""


@pytest.mark.parametrize(
    "effects",
    [
        [saved("a"), PLAN, saved("start"), RAN, kept(7)],
        [PLAN, saved("x"), RAN, kept(3), saved("y"), PLAN, saved("start"), RAN, kept(7)],
        [PLAN, saved("start"), RAN, saved("worked"), RAN, kept(7)],  # merged into one program and run again
        [PLAN, saved("start"), RAN, saved("y"), PLAN, RAN, kept(7)],  # corrected, and planned once more as before
        [PLAN, saved("start"), RAN, saved("y"), PLAN, RAN, saved("worked"), RAN, kept(7)],  # both
    ],
)
def test_the_start_is_the_world_when_the_subtask_began(effects):
    assert start_of(history(*effects), 7) == b"start"


def test_a_log_without_worlds_has_no_start():
    assert start_of(history(PLAN, saved(""), RAN, kept(7)), 7) is None
    assert start_of(history(PLAN, saved("start"), RAN, kept(7)), 8) is None


def template(code: str, key: str = "PLACE(cup, shelf)") -> Entry:
    with Skillbook("sqlite://") as one:
        return one.add_template(one.record_feedback("", "ana", subtask=key, kind="approval"), Key.parse(key), code)


@pytest.mark.parametrize(
    ("head", "call"),
    [
        ("thing, place, gap=0.1", "f('cup', 'shelf')"),
        ("thing='mug', gap=0.1", "f()"),
        ("thing, *, place", "f('cup', place='shelf')"),
    ],
)
def test_parameters_without_a_default_are_the_things_of_the_subtask(head, call):
    assert program_of(template(f"def f({head}):\n    look()\n")).endswith(f"\n\n\n{call}\n")


def test_a_function_that_needs_more_than_names_cannot_be_run():
    with pytest.raises(CannotRetest, match="needs more"):
        program_of(template("def f(thing, place, height):\n    look()\n"))
