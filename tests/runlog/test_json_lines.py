"""Files of results: whatever a killed process left of its last line, the rest is read and the next ones are added."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, strategies as st

from memo_core.runlog.json_lines import append_line, make_writable, read_lines

VALUES = [{"task": "öffne …", "seed": number, "done": number % 2 == 0} for number in range(4)]


@given(st.data())
def test_a_file_that_was_cut_off_anywhere_and_gone_on_with_twice_loses_the_cut_line_only(tmp_path_factory, data):
    file: Path = tmp_path_factory.mktemp("lines") / "deep" / "out.jsonl"
    for value in VALUES:
        append_line(file, value)
    written = file.read_bytes()
    for _ in range(2):  # each process finds what the one before left
        before = [value for _, value in read_lines(file)]
        last = written.rstrip(b"\n").rfind(b"\n") + 1
        cut = data.draw(st.integers(last, len(written) - 2))
        file.write_bytes(written[:cut])
        assert [value for _, value in read_lines(file)] == before[:-1]
        append_line(file, {"task": "next", "seed": cut})
        assert [value for _, value in read_lines(file)] == [*before[:-1], {"task": "next", "seed": cut}]
        written = file.read_bytes()


def test_what_is_no_result_is_seen_with_its_line(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_bytes(b'{"a": 1}\nhello\n\n{"b"}\n[1, 2]\n\xff\xfe\n')
    assert list(read_lines(file)) == [(1, {"a": 1}), (2, None), (4, None), (5, [1, 2]), (6, None)]


def test_to_make_it_writable_changes_nothing_that_is_there(tmp_path):
    make_writable(tmp_path / "new" / "out.jsonl")
    assert (tmp_path / "new" / "out.jsonl").read_bytes() == b""
    append_line(tmp_path / "new" / "out.jsonl", {})
    make_writable(tmp_path / "new" / "out.jsonl")
    assert (tmp_path / "new" / "out.jsonl").read_bytes() == b"{}\n"
