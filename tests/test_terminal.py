"""The person at the terminal: whatever they type is heard, and no odd terminal ends a run."""

from __future__ import annotations

import getpass
import io
import os
import subprocess
import sys

import pytest

from memo_core.errors import InvalidArgument
from memo_core.experiment.terminal import TerminalSettings, TerminalTeacher
from memo_core.interfaces.teacher import Episode
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose

ASK = """
from memo_core.experiment.terminal import TerminalSettings, TerminalTeacher
from types import SimpleNamespace
teacher = TerminalTeacher(TerminalSettings(who="ana"))
teacher.open()
episode = SimpleNamespace(subtask="OPEN(door)", attempt=1, spoken_error="")
print(teacher.judge(episode).words.encode("utf-8").hex())
"""


@pytest.mark.parametrize("mode", ["0", "1"])
@pytest.mark.parametrize("typed", ["ziehe über die Tür".encode("latin-1"), "ziehe über die Tür".encode()])
def test_words_in_any_encoding_arrive_as_text_that_a_book_can_hold(mode, typed):
    environment = os.environ | {"PYTHONUTF8": mode, "LC_ALL": "C.UTF-8", "PYTHONIOENCODING": ""}
    heard = subprocess.run([sys.executable, "-c", ASK], input=typed + b"\n", capture_output=True, env=environment)
    assert heard.returncode == 0, heard.stderr.decode()
    assert bytes.fromhex(heard.stdout.decode().strip()).decode() == "ziehe über die Tür"


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
    assert teacher.judge(_episode()).kind == "silent", "the end of input means that nobody watches"


def _episode() -> Episode:
    pose = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    scene = SceneGraph("kitchen", (), (), Observation(end_effector=pose, gripper_width=0.0, holding=False))
    return Episode("open the door", "OPEN(door)", 1, scene, scene)
