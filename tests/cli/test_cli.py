"""The shell: one clear line for what people can act on, never a traceback, one JSON document where one is asked for."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from memo_core.cli.app import COMMANDS
from memo_core.cli.main import main
from memo_core.cli.tasks import read_seeds
from memo_core.errors import InvalidArgument
from memo_core.runlog.event_log import EventLog, read_events
from memo_core.skillbook.book import Skillbook


def run(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def memo(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name, capsys):
    assert run(name, "--help") == 0
    assert "Usage: memo" in capsys.readouterr().out


def test_help_lists_every_command(capsys):
    assert run("--help") == 0
    said = capsys.readouterr().out
    assert all(name in said for name in COMMANDS)


def test_a_mistyped_command_gets_the_near_one(capsys):
    assert run("tsks") == 2
    assert "tasks" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["config", "check", "no-such-file.yaml"], 2, "no such file"),
        (["run", "--task", "stack-the-cubes", "--set", "sed=3"], 2, "did you mean 'seed'"),
        (["run"], 2, "task"),
        (["exec", "no-such-file.py", "--task", "x"], 2, "no-such-file.py"),
        (["tasks", "show", "no-such-task"], 2, "unknown task"),
        (["tasks", "verify", "--seeds", "9-2"], 2, "--seeds"),
        (["plugins", "check", "no-such-backend"], 2, "unknown backend"),
        (["skillbook", "list", "--book", "no-such-book.db"], 1, "no-such-book.db"),
        (["skillbook", "list", "--kind", "lesson"], 2, "--kind"),
        (["prompts", "show", "pla"], 2, "did you mean 'plan'"),
        (["bench", "lesions", "--lesion", "mirrord"], 2, "did you mean 'mirrored'"),
        (["run", "a.yaml", "--config", "b.yaml"], 2, "one file"),
        (["config", "show", "a.yaml", "--config", "b.yaml"], 2, "one file"),
    ],
)
def test_a_mistake_is_one_clear_line_on_stderr(arguments, code, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments) == code
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.startswith("memo: ") and len(captured.err.strip().splitlines()) == 1
    assert captured.out == "" and "Traceback" not in captured.err


@pytest.mark.process
def test_debug_shows_where_wherever_it_stands(tmp_path):
    for arguments in (["--debug", "prompts", "show", "x"], ["prompts", "show", "x", "--debug"]):
        assert "Traceback" in memo(*arguments).stderr
    assert "Traceback" in memo("prompts", "show", "x", env=os.environ | {"MEMO_DEBUG": "1"}).stderr


@pytest.mark.parametrize(
    ("module", "told"),
    [
        ("pinocchio", r"moving a robot needs the Python module pinocchio \(.*install.*\[arm\]"),
        ("PIL.Image", r"writing videos needs the Python module PIL \(.*install.*\[video\]"),
        ("pydantic_monty", r"memo-core needs the Python module pydantic_monty \(.*pip install .*\)"),
        ("somewhere", r"unexpected ModuleNotFoundError: No module named 'somewhere' \(a bug"),
    ],
)
def test_a_module_of_an_optional_part_is_named_with_the_command_that_installs_it(monkeypatch, capsys, module, told):
    def lacks(*_: object) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr("memo_core.cli.prompts.load", lacks)
    assert run("prompts", "show", "skills") == (70 if "unexpected" in told else 1)
    assert re.search(told, capsys.readouterr().err)


def test_an_unexpected_error_is_a_line_that_says_how_to_see_more(monkeypatch, capsys):
    import memo_core.cli.prompts as prompts

    def fails(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(prompts, "load", fails)
    assert run("prompts", "show", "skills") == 70
    said = capsys.readouterr().err
    assert "ZeroDivisionError" in said and "--debug" in said and len(said.strip().splitlines()) == 1


# Says so when the guard is entered: what comes before is Python's own.
TELLING = """
import sys
from memo_core.cli.main import main

def tell(frame, event, _):
    if frame.f_code.co_name == "_run":
        sys.setprofile(None)
        print(flush=True)

sys.setprofile(tell)
main(["bench", "startup", "--runs", "100"])
"""


@pytest.mark.process
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.1, 0.3, 0.8])
def test_ctrl_c_is_never_a_traceback(delay, tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", TELLING], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    assert process.stdout is not None
    try:
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert "Traceback" not in said and "interrupted" in said


@pytest.mark.process
def test_a_reader_that_goes_away_is_no_error():
    command = f"{sys.executable} -m memo_core.cli.main config schema | head -c 10"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    assert done.stderr == ""


@pytest.mark.process
@pytest.mark.parametrize(("last", "code", "said"), [("", 0, ""), ("1 / 0", 1, "memo: p.py: line 3: ZeroDivisionError")])
def test_a_program_goes_on_when_its_reader_goes_away_and_is_judged_by_what_it_does(tmp_path, last, code, said):
    (tmp_path / "p.py").write_text(f"for i in range(300):\n    print(i)\n{last}\n")
    ours, theirs = os.pipe()
    os.close(ours)
    try:
        command = [sys.executable, "-m", "memo_core.cli.main", "exec", "p.py", "--task", "stack-the-cubes"]
        done = subprocess.run(command, stdout=theirs, stderr=subprocess.PIPE, text=True, cwd=tmp_path, timeout=120)
    finally:
        os.close(theirs)
    assert done.returncode == code
    verdict, *rest = done.stderr.splitlines()
    assert verdict.startswith("memo: stack-the-cubes, seed 0: not done (")
    assert len(rest) == bool(said) and "".join(rest).startswith(said)


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that Linux has")
@pytest.mark.parametrize("arguments", [["--version"], ["config", "show"], ["tasks", "list", "--json"]], ids=" ".join)
def test_output_that_cannot_be_written_is_said_in_one_line(arguments):
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
        assert (done.returncode, done.stderr) == (1, "memo: stdout cannot be written: No space left on device\n")
        assert subprocess.run(command, stdout=subprocess.DEVNULL, stderr=full, timeout=60).returncode == 0


@pytest.mark.parametrize(
    "arguments",
    [["plugins", "list"], ["config", "show"], ["prompts", "show"], ["tasks", "list"], ["doctor", "--quick"]],
    ids=" ".join,
)
def test_json_is_one_document_and_nothing_else(arguments, capsys):
    run(*arguments, "--json")
    assert isinstance(json.loads(capsys.readouterr().out), dict)


def test_a_list_of_tasks_says_by_which_commands_the_model_was_measured_and_prints_no_date(capsys):
    assert run("tasks", "list", "--set", "llm.backend=offline") == 0
    captured = capsys.readouterr()
    assert "untaught: memo run --task TASK --seed 0 --teacher silent" in captured.err
    assert "taught: memo run --task TASK --seed 0 --teacher simulated" in captured.err
    assert not re.search(r"\d{4}-\d{2}-\d{2}", captured.out + captured.err)
    assert "types: LH long horizon, CR contact-rich, SR semantic reasoning, TR translation and rotation" in captured.err


@pytest.mark.parametrize(
    ("text", "seeds"), [("0-3", (0, 1, 2, 3)), ("7", (7,)), ("1,4-6", (1, 4, 5, 6)), ("2,2", (2,)), (" 1 , 2 ", (1, 2))]
)
def test_seeds_are_read(text, seeds):
    assert read_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "3-1", "1-", "-1", "1..3", "0-99999999999", "0-9999,10000"])
def test_what_are_no_seeds_is_an_error(text):
    with pytest.raises(InvalidArgument):
        read_seeds(text)


# -- memo skillbook ----------------------------------------------------------------------------------------------------
@pytest.fixture
def book(tmp_path: Path) -> Path:
    path = tmp_path / "book.db"
    with Skillbook(str(path)) as opened:
        anna = opened.record_feedback("pull it in an arc", "anna", task="open it", subtask="OPEN(microwave)")
        opened.add_lessons(anna, "OPEN(microwave)", ["Pull the handle along an arc."], ["Doors turn about hinges."])
        ben = opened.record_feedback("not so fast", "ben", task="move it", subtask="PICK(cup)")
        opened.add_lessons(ben, "PICK(cup)", ["Move slowly."], [])
    return path


def as_json(capsys, *arguments: str) -> dict:
    assert run(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_a_book_can_be_looked_into(book, capsys):
    entries = as_json(capsys, "skillbook", "list", "--book", str(book))["entries"]
    assert [entry["kind"] for entry in entries] == ["correction", "general", "correction"]
    assert run("skillbook", "list", "--book", str(book)) == 0
    assert "uses a/b: retrieved b times" in capsys.readouterr().err
    [mine] = as_json(capsys, "skillbook", "list", "--book", str(book), "--who", "ben")["entries"]
    assert mine["text"] == "Move slowly."
    shown = as_json(capsys, "skillbook", "show", str(mine["id"]), "--book", str(book))
    assert shown["from"]["words"] == "not so fast"
    assert as_json(capsys, "skillbook", "stats", "--book", str(book))["corrections"] == 2


def test_words_that_no_entry_was_made_of_are_listed_with_the_reason(book, capsys):
    with Skillbook(str(book)) as opened:
        parked = opened.record_feedback("mind the gap", "ben", subtask="PICK(cup)")
        opened.park(parked, "both lists are empty")
        opened.record_feedback("a bit higher", "anna", subtask="PICK(cup)")
    waiting = as_json(capsys, "skillbook", "list", "--book", str(book))["waiting"]
    assert [(one["words"], one["status"], one["reason"]) for one in waiting] == [
        ("mind the gap", "parked", "both lists are empty"),
        ("a bit higher", "pending", ""),
    ]
    assert run("skillbook", "list", "--book", str(book)) == 0
    said = capsys.readouterr().err
    assert "mind the gap" in said and "both lists are empty" in said and "a bit higher" in said


def test_a_book_can_be_exported(book, capsys, tmp_path):
    out = tmp_path / "export.jsonl"
    assert run("skillbook", "export", "--book", str(book), "--out", str(out)) == 0
    first, *records = [json.loads(line) for line in out.read_text().splitlines()]
    assert first["record"] == "book"
    words = {record["words"] for record in records if record["record"] == "feedback"}
    assert words == {"pull it in an arc", "not so fast"}
    assert sum(record["record"] == "entry" for record in records) == 3


def test_a_person_can_withdraw_and_is_asked_for_in_a_script(book, capsys):
    assert run("skillbook", "forget", "anna", "--book", str(book)) == 2
    assert "--yes" in capsys.readouterr().err
    assert as_json(capsys, "skillbook", "forget", "anna", "--yes", "--book", str(book))["entries"] == 2
    assert [e["text"] for e in as_json(capsys, "skillbook", "list", "--book", str(book))["entries"]] == ["Move slowly."]
    assert run("skillbook", "forget", "anna", "--yes", "--book", str(book)) == 2


def test_nothing_is_forgotten_while_a_run_of_the_book_writes_to_its_files(book, capsys, tmp_path):
    trial, started = tmp_path / "experiment" / "trial", tmp_path / "started-by-hand"
    with Skillbook(str(book)) as opened:
        opened.note_place("run", tmp_path / "experiment")  # an evaluation: its runs are below
    said = '{"event": "FeedbackGiven", "who": "anna", "words": "pull it in an arc"}'
    for folder, further in ((trial, []), (started, ["--in", str(started)])):
        folder.mkdir(parents=True)
        log = EventLog(folder, "--out")
        log.append(said)
        assert run("skillbook", "forget", "anna", "--yes", "--book", str(book), *further) == 2
        assert str(folder) in capsys.readouterr().err
        log.append(said)
        log.close()
        assert len(read_events(folder)) == 2, "the log is still the one that the run writes to"
    assert as_json(capsys, "skillbook", "stats", "--book", str(book))["feedback"] == 2
    assert run("skillbook", "forget", "anna", "--yes", "--book", str(book), "--in", str(started)) == 0
    assert "pull it" not in (trial / "events.jsonl").read_text() + (started / "events.jsonl").read_text()


def test_a_mistyped_book_is_not_made(tmp_path, capsys):
    missing = tmp_path / "none.db"
    for command in (["stats"], ["forget", "anna", "--yes"], ["reembed"]):
        assert run("skillbook", *command, "--book", str(missing)) != 0
    assert not missing.exists()


@pytest.mark.process
def test_code_that_is_refused_for_a_thousand_reasons_is_refused_in_one_short_line(tmp_path, capsys):
    many = tmp_path / "many.py"
    many.write_text("".join(f"nothing_{i}()\n" for i in range(1000)))
    assert run("exec", str(many), "--task", "stack-the-cubes") == 1
    [line] = capsys.readouterr().err.strip().splitlines()
    assert "not run: line 1" in line and "more" in line and len(line) < 2200


@pytest.mark.sim
def test_exec_prints_the_verdict_of_the_success_check_beside_the_output_of_the_code(tmp_path, capsys):
    from memo_core.cli.options import load
    from memo_core.runs.factories import task_of

    task, code = "put-the-cube-away", tmp_path / "code.py"
    code.write_text("print('hello')\n")
    assert run("exec", str(code), "--task", task) == 0
    told = capsys.readouterr()
    verdict, joints = told.err.splitlines()
    assert told.out == "hello\n" and verdict.startswith(f"memo: {task}, seed 0: not done (")
    assert joints.startswith("memo: joints (rad, m): ") and "slide 0.0" in joints
    code.write_text(task_of(load(None, None, task)[1], task).reference_solution)
    assert run("exec", str(code), "--task", task, "--seed", "1") == 0
    assert capsys.readouterr().err.startswith(f"memo: {task}, seed 1: done (")


def test_what_a_skill_does_is_said_in_a_whole_sentence(capsys):
    assert run("skills", "list") == 0
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines() if "(" in line and " -> " in line]
    assert len(lines) > 20 and all(line.endswith(".") for line in lines)


@pytest.mark.process
def test_a_demo_that_could_not_take_place_is_no_success(monkeypatch, tmp_path, capsys):
    from memo_core.environment.simulated import SimulatedEnvironment
    from memo_core.errors import BackendUnavailable

    def unavailable(world: SimulatedEnvironment) -> None:
        raise BackendUnavailable("simulator", "mujoco", "a library is missing")

    monkeypatch.setattr(SimulatedEnvironment, "open", unavailable)
    assert run("demo", "--seed", "0", "--out", str(tmp_path), "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["told"] and "a library is missing" in told["reasons"]["transfer"]


def test_a_demo_that_cannot_begin_is_refused_before_anything_is_written(tmp_path, capsys):
    assert run("demo", "--set", "robot.driver.backend=franka", "--out", str(tmp_path / "runs")) != 0
    assert "franka" in capsys.readouterr().err and not (tmp_path / "runs").exists()


@pytest.mark.process
def test_an_interrupt_that_came_through_exec_ends_with_130_also_under_python_m(tmp_path):
    """Python kills such a process with SIGINT, although the exception was caught: libraries use exec while imported."""
    (tmp_path / "interrupted.py").write_text(
        "from memo_core.cli import main\nmain._run = lambda *_: exec('raise KeyboardInterrupt')\nmain.main()\n"
    )
    command = [sys.executable, "-m", "interrupted"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, "memo: interrupted\n")


@pytest.mark.process
def test_an_interrupted_import_that_ends_in_another_error_is_an_interrupt(tmp_path):
    (tmp_path / "interrupted.py").write_text(
        "import os, signal\n"
        "from memo_core.cli import app, main\n"
        "def run_app(given):\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "    except KeyboardInterrupt:\n"
        "        raise ImportError('half imported') from None\n"
        "app.run_app = run_app\n"
        "main.main()\n"
    )
    done = subprocess.run([sys.executable, "interrupted.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, "memo: interrupted\n")
