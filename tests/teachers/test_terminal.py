"""The person at the terminal: whatever they type is heard, and no odd terminal ends a run."""

from __future__ import annotations

import getpass
import io
import os
import subprocess
import sys

import attrs
import pytest

from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Arrangement, Program
from memo_core.teachers.answers import meaning_of
from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher
from memo_core.testing.teacher import episodes, noted, proposals, task_episodes
from memo_core.text.reading_limits import LONGEST_WORDS

ASK = """
from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher
from memo_core.testing.teacher import episodes
teacher = TerminalTeacher(TerminalSettings(who="ana"))
teacher.open()
print(teacher.judge(episodes()[0]).words.encode("utf-8").hex())
"""


@pytest.mark.process
@pytest.mark.parametrize("mode", ["0", "1"])
@pytest.mark.parametrize("typed", ["ziehe über die Tür".encode("latin-1"), "ziehe über die Tür".encode()])
def test_words_in_any_encoding_arrive_as_text_that_a_book_can_hold(mode, typed):
    environment = os.environ | {"PYTHONUTF8": mode, "LC_ALL": "C.UTF-8", "PYTHONIOENCODING": ""}
    heard = subprocess.run([sys.executable, "-c", ASK], input=typed + b"\n", capture_output=True, env=environment)
    assert heard.returncode == 0, heard.stderr.decode()
    assert bytes.fromhex(heard.stdout.decode().strip()).decode() == "ziehe über die Tür"


TWICE = """
import sys
from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher
from memo_core.testing.teacher import episodes
first = sys.stdin.readline()
for name in ("ana", "ben"):
    teacher = TerminalTeacher(TerminalSettings(who=name))
    teacher.open()
    print(name, teacher.judge(episodes()[0]).words, teacher.left)
    teacher.close()
"""


@pytest.mark.process
def test_one_process_asks_several_people_one_after_the_other_also_where_input_was_read_before():
    heard = subprocess.run(
        [sys.executable, "-c", TWICE], input="x\ngo higher\ngo lower", capture_output=True, text=True
    )
    assert heard.returncode == 0, heard.stderr
    assert heard.stdout.splitlines() == ["ana go higher False", "ben go lower False"]


def test_a_person_has_left_when_the_input_has_ended(monkeypatch):
    teacher = typing(monkeypatch, "go higher")
    teacher.judge(episodes()[0])
    assert not teacher.left
    teacher.judge(episodes()[0])
    assert teacher.left


def test_a_closed_standard_input_is_said_in_one_line(monkeypatch):
    closed = io.StringIO()
    closed.close()
    for nothing in (None, closed):
        monkeypatch.setattr(sys, "stdin", nothing)
        with pytest.raises(InvalidArgument, match="standard input is closed"):
            TerminalTeacher(TerminalSettings(who="ana")).open()


@pytest.mark.parametrize("error", [OSError("no such user"), KeyError("uid"), ImportError("pwd")])
def test_a_user_without_a_login_name_is_anonymous(monkeypatch, error):
    def unknown() -> str:
        raise error

    monkeypatch.setattr(getpass, "getuser", unknown)
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    teacher = TerminalTeacher(TerminalSettings())
    teacher.open()
    assert teacher.who == "anonymous"
    assert teacher.judge(episodes()[0]).kind == "silent", "the end of input means that nobody watches"


def test_the_end_of_input_is_told_with_what_it_was_taken_for(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    teacher = TerminalTeacher(TerminalSettings(who="ana"))
    teacher.open()
    episode = episodes()[0]
    cases = {
        "nothing was said: it stays open whether it worked": lambda: teacher.judge(episode),
        "taken as no": lambda: teacher.put_back(episode),
        "the program is not released": lambda: teacher.permit(Program("lift it", "LIFT(cube)", 1, "look()")),
    }
    for taken, ask in cases.items():
        ask()
        lines = [line for line in capsys.readouterr().err.splitlines() if "input ended" in line]
        assert lines == [f"memo: input ended, so nobody answers: {taken}"]


def typing(monkeypatch, *lines: str, **settings) -> TerminalTeacher:
    """A teacher whose person types these lines, into a pipe."""
    monkeypatch.setattr(sys, "stdin", io.StringIO("".join(f"{line}\n" for line in lines)))
    teacher = TerminalTeacher(TerminalSettings(who="ana", **settings))
    teacher.open()
    return teacher


APPROVING = [
    "y", "Yes!", "Great job, thanks!", "good", "Perfect.", "that worked", "well done", "it works now", "that's right",
    "Nice work, robot", "all right", "ok thanks", "yes, that's it", "very good", "It worked, thank you so much!",
]  # fmt: skip
CORRECTING = [
    "no, an arc", "more to the right", "the right one", "not good", "a bit lower", "wrong", "you forgot the napkin",
    "go up", "turn it further", "to the right", "don't squeeze it", "open it all the way", "stop",
]  # fmt: skip
DOUBTFUL = ["good, but a bit lower", "Great, now go up", "right", "yes but slower", "nice try", "it worked, almost"]


@pytest.mark.parametrize("words", APPROVING)
def test_praise_is_approval(words):
    assert meaning_of(words) == "approve"


@pytest.mark.parametrize("words", CORRECTING)
def test_what_is_no_praise_is_a_correction(words):
    assert meaning_of(words) == "correct"


@pytest.mark.parametrize("words", DOUBTFUL)
def test_praise_that_says_more_is_asked_back(monkeypatch, capsys, words):
    assert meaning_of(words) == "unsure"
    assert typing(monkeypatch, words, "y").judge(episodes()[0]).kind == "approve"
    assert typing(monkeypatch, words, "c").judge(episodes()[0]).words == words
    assert "is it fine as it is" in capsys.readouterr().err


IN_OTHER_WORDS = [
    "ja", "oui", "👍", "👍🏽", "ye", "yup", "sí", "да", "はい", "d'accord", "Ja!", "muy bien", "nein", "нет", "hm",
    "!", "👎👎",
]  # fmt: skip


@pytest.mark.parametrize("words", IN_OTHER_WORDS)
def test_a_yes_or_no_in_other_words_is_asked_back_and_never_a_correction_by_itself(monkeypatch, words):
    episode = episodes()[0]
    assert typing(monkeypatch, words, "y").judge(episode).kind == "approve"
    assert typing(monkeypatch, words).judge(episode).kind == "silent"
    assert typing(monkeypatch, words, "pull it in an arc").judge(episode).words == "pull it in an arc"
    assert typing(monkeypatch, words, "y").judge_task(task_episodes()[0]).kind == "approve"
    assert typing(monkeypatch, words, "y", plans=True).judge_plan(proposals()[0]).kind == "approve"
    reaction = typing(monkeypatch, words, "y").read_back(noted()[0])
    assert (reaction.kind, reaction.words) == ("accepted", "")
    assert typing(monkeypatch, words, "y").permit(PROGRAM).kind == "approve"
    assert typing(monkeypatch, words, "y").put_back(episode) is True


@pytest.mark.parametrize("words", ["lower", "slower", "gently", "stop", "2 cm lower", "go up", "tiefer bitte, ja da"])
def test_a_short_correction_is_taken_without_asking_back(monkeypatch, words):
    assert typing(monkeypatch, words).judge(episodes()[0]).words == words


@pytest.mark.parametrize("mark", ["!", "!!", ".", " !"])
def test_an_exclamation_mark_changes_nothing(monkeypatch, mark):
    episode = episodes()[0]
    for words in ("y", "yes", "ok", "s", "no", "stop", "?", "nothing", "right"):
        assert meaning_of(words + mark) == meaning_of(words), words
    assert typing(monkeypatch, "y" + mark).put_back(episode) and typing(monkeypatch, "done" + mark).put_back(episode)
    assert not typing(monkeypatch, "no" + mark).put_back(episode)
    assert typing(monkeypatch, "yes" + mark).permit(PROGRAM).kind == "approve"
    assert typing(monkeypatch, "n" + mark).permit(PROGRAM).kind == "silent"
    assert typing(monkeypatch, "x" + mark).read_back(noted()[0]).kind == "struck"
    assert typing(monkeypatch, "no" + mark, "y").read_back(noted()[0]).kind == "accepted"


def test_the_help_says_how_much_is_read(monkeypatch, capsys):
    typing(monkeypatch, "?", "y").judge(episodes()[0])
    assert f"At most {LONGEST_WORDS}" in capsys.readouterr().err


@pytest.mark.parametrize("unit", ["a b ", "👍", "x", "y", ", ", "yes ", "'", "plan: "])
def test_words_of_any_length_arrive_as_they_were_typed(monkeypatch, unit):
    words = (unit * 1_000_000).strip()
    verdict = typing(monkeypatch, words).judge(episodes()[0])
    told = words.removeprefix("plan:").strip()
    assert (verdict.kind, verdict.words == told) == ("correct", True)
    assert typing(monkeypatch, words).read_back(noted()[0]).words == words
    assert typing(monkeypatch, words, "n").put_back(episodes()[0]) is False


def test_empty_asks_again_and_a_question_mark_explains(monkeypatch, capsys):
    verdict = typing(monkeypatch, "", "   ", "?", "a bit lower").judge(episodes()[0])
    assert verdict.words == "a bit lower"
    shown = capsys.readouterr().err
    assert shown.count("Did it work?") == 4 and "put the cube in the bowl" in shown and "plan:" in shown


def test_words_about_the_plan_can_be_marked_as_such(monkeypatch):
    verdict = typing(monkeypatch, "plan: open the door first").judge(episodes()[0])
    assert verdict.about_plan and verdict.words == "open the door first"
    assert typing(monkeypatch, "plan:", "s").judge(episodes()[0]).kind == "silent"


def test_picture_and_video_stand_beside_the_question(monkeypatch, capsys):
    episode = attrs.evolve(episodes()[0], recordings=("runs/x/pictures/1.png", "runs/x/video/1.mp4"))
    typing(monkeypatch, "y").judge(episode)
    shown = capsys.readouterr().err
    assert shown.index("runs/x/video/1.mp4") < shown.index("Did it work?")


def test_the_whole_task_is_asked_about(monkeypatch, capsys):
    verdict = typing(monkeypatch, "?", "you forgot the napkin").judge_task(task_episodes()[0])
    assert verdict.kind == "correct" and verdict.words == "you forgot the napkin"
    shown = capsys.readouterr().err
    assert "put the cube in the bowl" in shown and "the red cube is in the bowl" in shown


def test_plans_are_asked_about_only_when_wanted(monkeypatch):
    assert typing(monkeypatch, "open it first").judge_plan(proposals()[0]).kind == "silent"
    objected = typing(monkeypatch, "open it first", plans=True).judge_plan(proposals()[0])
    assert objected.about_plan and objected.words == "open it first"
    assert typing(monkeypatch, "y", plans=True).judge_plan(proposals()[0]).kind == "approve"


@pytest.mark.parametrize(
    ("typed", "kind", "words", "struck"),
    [
        (["", "y"], "accepted", "", ()),
        (["x"], "struck", "", ()),
        (["x 2"], "struck", "", (1,)),
        (["strike 1, 2"], "struck", "", (0, 1)),
        (["no", "only for this drawer"], "reworded", "only for this drawer", ()),
        (["x 3", "y"], "accepted", "", ()),
        ([], "accepted", "", ()),
    ],
)
def test_notes_are_accepted_struck_or_said_anew(monkeypatch, capsys, typed, kind, words, struck):
    answer = typing(monkeypatch, *typed).read_back(noted()[0])
    assert (answer.kind, answer.words, answer.struck) == (kind, words, struck)
    shown = capsys.readouterr().err
    assert "OPEN(drawer): Pull the handle straight." in shown and "everywhere: Approach handles" in shown
    assert "x 2 = strike only note 2" in shown


def test_nothing_learnt_is_answered_with_a_question(monkeypatch, capsys):
    answer = typing(monkeypatch, "", "go lower").read_back(noted()[1])
    assert answer.kind == "reworded" and answer.words == "go lower"
    assert "What should be done differently?" in capsys.readouterr().err
    assert typing(monkeypatch, "s").read_back(noted()[1]).kind == "accepted"


@pytest.mark.parametrize("typed", ["y", "yes", "ja", "good", "n", "nein"])
def test_yes_or_no_where_nothing_was_learnt_repeats_the_question(monkeypatch, capsys, typed):
    answer = typing(monkeypatch, typed, "go lower").read_back(noted()[1])
    assert (answer.kind, answer.words) == ("reworded", "go lower")
    shown = capsys.readouterr().err
    assert shown.count("What should be done differently?") == 2 and "y =" not in shown


def test_read_back_can_be_switched_off():
    assert TerminalTeacher(TerminalSettings()).reads_back
    assert not TerminalTeacher(TerminalSettings(read_back=False)).reads_back


@pytest.mark.parametrize("ask", ["put_back", "confirm"])
@pytest.mark.parametrize(("typed", "agreed"), [(["", "hm", "y"], True), (["n"], False), ([], False)])
def test_only_a_yes_lets_a_robot_that_cannot_undo_go_on(monkeypatch, ask, typed, agreed):
    teacher = typing(monkeypatch, *typed)
    assert getattr(teacher, ask)(episodes()[0]) is agreed


def test_a_scene_is_asked_for_without_the_method(monkeypatch, capsys):
    asked = Arrangement("put the cube away", scene=2, number=3, of=12)
    assert typing(monkeypatch, "", "y").set_up(asked) and not typing(monkeypatch, "n").set_up(asked)
    assert not typing(monkeypatch).set_up(asked), "nobody there"
    assert 'Trial 3 of 12: "put the cube away". Please set up arrangement 2' in capsys.readouterr().err


PROGRAM = Program("put the cube away", "LIFT(cube)", 1, "move_to([0.4, 0.0, 0.3])")


@pytest.mark.parametrize(
    ("typed", "kind", "words"),
    [("y", "approve", ""), ("n", "silent", ""), ("mind the lamp", "correct", "mind the lamp")],
)
def test_a_program_is_shown_whole_and_released_only_by_a_plain_yes(monkeypatch, capsys, typed, kind, words):
    verdict = typing(monkeypatch, "", "fine", typed).permit(PROGRAM)
    assert (verdict.kind, verdict.words) == (kind, words)
    shown = capsys.readouterr().err
    assert PROGRAM.code in shown and shown.count("May it move the robot?") == 3


def test_nobody_at_the_terminal_releases_nothing(monkeypatch):
    assert typing(monkeypatch).permit(PROGRAM).kind == "silent"


def test_what_is_put_back_is_named_with_where_it_stood(monkeypatch, capsys):
    episode = next(one for one in episodes() if one.before.nodes)
    before = attrs.evolve(episode.before, nodes=(episode.before.nodes[0],))
    gone = attrs.evolve(episode, before=before, after=attrs.evolve(before, nodes=()), recordings=("stood.png",))
    assert typing(monkeypatch, "done").put_back(gone)
    shown = capsys.readouterr().err
    assert f"{before.nodes[0].label} stood at" in shown and "cm ahead" in shown and "see stood.png" in shown
