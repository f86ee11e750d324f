"""No command lets text from outside speak to the terminal: escape sequences in books, files, configs, code and
arguments are shown, never obeyed."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from memo_core.cli.main import main
from memo_core.skillbook.book import Skillbook
from memo_core.text.terminal import console, printable

ROOT = Path(__file__).parents[2]

# clear the screen, write the clipboard (OSC 52), the same as one character (C1), go back in the line, turn text round
EVIL = "\x1b[2J\x1b]52;c;ZXZpbA==\x07\x9b2J\rgone\u202edlrow\x7f\x08"
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("evil")
    with Skillbook(str(place / "book.db")) as book:
        said = book.record_feedback(f"an arc! {EVIL}", f"ana{EVIL}", task=f"t{EVIL}", subtask=f"OPEN(door{EVIL})")
        book.add_lessons(said, "OPEN(door)", [f"Pull it. {EVIL}"])
        book.add_lessons(book.record_feedback("again", "ben"), "OPEN(door)", [f"Pull it along an arc. {EVIL}"])
        approval = book.record_feedback("", f"ana{EVIL}", kind="approval")
        book.add_template(approval, "OPEN(door)", f'def pull(name):\n    """{EVIL}"""\n')
        book.add_lessons(book.record_feedback("slow", "ana"), "OPEN(door)", [], [f"Go slowly. {EVIL}"])
    (place / "config.yaml").write_text(json.dumps({f"ta{EVIL}sk": 1, "llm": {"backend": f"x{EVIL}"}}))
    (place / "syntax.yaml").write_bytes(f"task: [{EVIL}".encode())
    (place / "print.py").write_text(f"print({EVIL!r})\nraise ValueError({EVIL!r})\n")
    (place / "comment.py").write_text(f"x = 1 # {EVIL[:4]}\nfoo{EVIL[8:9]}bar()\n", newline="")
    (place / "book.jsonl").write_text(json.dumps({"record": f"bo{EVIL}ok", "format": EVIL}) + "\n")
    (place / "plan.md.j2").write_text("{{ ta" + EVIL + "sk }}")
    return place


COMMANDS = {
    "list": "skillbook list --book book.db",
    "list as JSON": "skillbook list --book book.db --json",
    "show 1": "skillbook show 1 --book book.db",
    "show 3": "skillbook show 3 --book book.db",
    "stats": "skillbook stats --book book.db",
    "history": "skillbook history --book book.db",
    "export": "skillbook export --book book.db",
    "search": "skillbook search OPEN(door) --book book.db",
    "edit": "skillbook edit 1 EVIL --book book.db",
    "remove": "skillbook remove 1 --who EVIL --book book.db",
    "history of a key": "skillbook history OPEN(door) --book book.db",
    "forget": "skillbook forget EVIL --book book.db",
    "cluster": "cluster --book book.db --dry-run",
    "config check": "config check config.yaml",
    "config syntax": "config check syntax.yaml",
    "config show": "config show config.yaml",
    "import": "skillbook import book.jsonl --book other.db",
    "prompts": "config check --set prompts.plan=plan.md.j2",
    "an unknown option": "skillbook list --EVIL",
    "an unknown command": "EVIL",
    "an unknown task": "exec print.py --task EVIL",
    "exec": "exec print.py --task put-the-cube-away",
    "exec of a comment": "exec comment.py --task put-the-cube-away",
    "run without a task": "run --task EVIL",
    "a resumed run": "run --resume EVIL",
    "tasks": "tasks show EVIL",
    "plugins": "plugins check EVIL",
    "budget": "budget EVIL",
}


@pytest.mark.sim
@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_prints_a_control_character(name, place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    with pytest.raises(SystemExit) as ended:
        main([EVIL if word == "EVIL" else word.replace("EVIL", "x" + EVIL) for word in COMMANDS[name].split()])
    said = capsys.readouterr()
    assert said.out or said.err
    assert ended.value.code != 70, said.err
    for text in (said.out, said.err):
        found = CONTROL.search(text)
        assert found is None, text[max(0, found.start() - 80) : found.end() + 20]


@pytest.mark.process
def test_what_a_terminal_gets_holds_no_sequence_but_colours(place):
    """The same on a real terminal, where Rich may write colours."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "memo_core.cli.main", "skillbook", "list", "--book", "book.db"]
    ended = subprocess.run(command, cwd=place, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, timeout=60)
    os.close(theirs)
    said = b""
    try:
        while piece := os.read(ours, 4096):
            said += piece
    except OSError:  # the other side is closed
        pass
    text = re.sub(r"\x1b\[[0-9;]*m", "", said.decode()).replace("\r\n", "\n")
    assert ended.returncode == 0 and "x1b" in text and CONTROL.search(text) is None


def test_a_console_shows_control_characters_and_keeps_its_own_colours():
    file = io.StringIO()
    shown = console(file=file, force_terminal=True, color_system="standard")
    shown.print(f"[bold]a {EVIL}[/]")
    text = re.sub(r"\x1b\[[0-9;]*m", "", file.getvalue())
    assert "\x1b[1m" in file.getvalue() and "\\x1b" in text and CONTROL.search(text) is None


def test_json_stays_the_same_json():
    document = json.dumps({"text": EVIL + "\ud800"}, ensure_ascii=False)
    assert json.loads(printable(document)) == json.loads(document)


def test_plain_text_passes_unchanged():
    text = "Zeile eins\n\tÜber 日本語 emoji 🦾 é\r\n"
    assert printable(text) == text


@pytest.mark.process
@pytest.mark.skipif(os.name != "posix", reason="closing streams in a POSIX shell")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("command", "code"), [("--version", 0), ("config show", 0), ("no-such-command", 2)])
def test_closed_standard_streams_change_no_exit_code(closed, command, code):
    line = f"{sys.executable} -m memo_core.cli.main {command} {closed}"
    found = subprocess.run(line, shell=True, capture_output=True, text=True)
    assert found.returncode == code, found.stderr


CLAIMS_NUMBERS = """
import os, sys
from memo_core.text.terminal import replace_closed_streams
replace_closed_streams()
print("lost")
opened = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT)
os._exit(opened)
"""


@pytest.mark.process
@pytest.mark.skipif(os.name != "posix", reason="closing streams in a POSIX shell")
def test_no_file_takes_the_number_of_a_closed_stream(tmp_path):
    (tmp_path / "script.py").write_text(CLAIMS_NUMBERS)
    line = f"{sys.executable} {tmp_path / 'script.py'} {tmp_path / 'book.db'} <&- >&- 2>&-"
    assert subprocess.run(line, shell=True, env=os.environ | {"PYTHONPATH": str(ROOT)}).returncode > 2


@pytest.mark.process
@pytest.mark.parametrize("arguments", [("exec", "-"), ("skillbook", "edit", "1", "-", "--book", "sqlite://")])
@pytest.mark.parametrize(("given", "said"), [(b"x \xff", "no UTF-8 from byte 2 on"), (None, "is closed")])
def test_text_from_standard_input_is_read_whole_or_refused(arguments, given, said):
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    shell = " ".join(command) + " <&-" if given is None else command
    found = subprocess.run(shell, input=given, shell=given is None, capture_output=True)
    assert found.returncode == 2 and said in found.stderr.decode()
