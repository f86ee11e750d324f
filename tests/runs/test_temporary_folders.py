"""What a killed process left in the temporary directory is cleared by the next one; what is in use is not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from memo_core.process.temporary_folders import PREFIX, scratch_folder

HOLD = """
import time
from memo_core.process.temporary_folders import scratch_folder
with scratch_folder() as folder:
    print(folder, flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_a_folder_is_there_in_the_block_and_gone_after_it(temporary):
    with scratch_folder() as folder:
        (folder / "file").write_text("x")
    assert not list(temporary.iterdir())


@pytest.mark.process
def test_what_a_killed_process_left_is_cleared_and_what_is_in_use_is_kept(temporary):
    killed, alive = (
        subprocess.Popen([sys.executable, "-c", HOLD], stdout=subprocess.PIPE, text=True) for _ in range(2)
    )
    left, kept = (Path(process.stdout.readline().strip()) for process in (killed, alive))
    os.kill(killed.pid, signal.SIGKILL)
    killed.wait()
    assert left.is_dir() and kept.is_dir()
    with scratch_folder() as folder:
        assert not left.exists() and kept.is_dir() and folder.is_dir()
    alive.kill()
    alive.wait()
    for process in (killed, alive):
        process.stdout.close()


def test_nothing_but_our_own_folders_is_cleared(temporary):
    (temporary / (PREFIX + "a-file")).write_text("not a folder")
    (temporary / "memo-else").mkdir()
    (temporary / "elsewhere").mkdir()
    (temporary / (PREFIX + "link")).symlink_to(temporary / "elsewhere")
    with scratch_folder():
        pass
    assert len(list(temporary.iterdir())) == 4
