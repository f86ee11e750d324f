"""Files that take the place of others only when they are complete."""

from __future__ import annotations

import pytest

from memo_core.runlog.whole_files import CannotWrite, clear_unfinished, whole_file, write_whole


def test_a_file_whose_writing_fails_leaves_the_old_one_and_nothing_else(tmp_path):
    file = write_whole(tmp_path / "export.jsonl", "old\n")
    with pytest.raises(RuntimeError), whole_file(file) as out:
        out.write(b"new\n")
        raise RuntimeError
    assert file.read_text() == "old\n" and list(tmp_path.iterdir()) == [file]


def test_what_cannot_be_written_is_named(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(CannotWrite, match="folder"):
        write_whole(tmp_path / "folder" / "file", "text")


def test_only_what_was_cut_off_is_cleared(tmp_path):
    kept = write_whole(tmp_path / "calls" / "0001-plan.json", "{}")
    (tmp_path / "calls" / ".0002-code.json.1.2.unfinished").write_text("{")
    clear_unfinished(tmp_path)
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [kept]
