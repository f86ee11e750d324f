"""Experiment files of strangers: bounded in time and memory, refused in one line with the place, no secret printed."""

from __future__ import annotations

import time

import pytest

from memo_core.cli.main import main
from memo_core.config.source import DEEPEST

LAUGHS = "a0: &a0 [x, x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 30))
MERGES = "a0: &a0 {k: 1}\n" + "".join(f"a{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}\n" for n in range(1, 30))
REFERENCES = "a0: x\n" + "".join(f"a{n}: ${{a{n - 1}}}${{a{n - 1}}}\n" for n in range(1, 30))
HOSTILE = {
    "aliases of aliases": (LAUGHS, "values, those behind aliases included"),
    "merges of merges": (MERGES, "values, those behind aliases included"),
    "references to references": (REFERENCES, "lead to more than"),
    "nested lists": ("task: " + "[" * 50_000 + "]" * 50_000, f"nested more than {DEEPEST} levels deep"),
    "nested mappings": ("task: " + "{a: " * 5_000 + "1" + "}" * 5_000, f"nested more than {DEEPEST} levels deep"),
    "nested references": ("task: " + "${" * 1_000 + "x" + "}" * 1_000, "task"),
    "a long reference": ("task: ${" + "x" * 50_000 + "}", "task"),
    "half a reference": ("task: ${x", "task"),
    "a base whose name is too long": ("extends: other." + "9" * 400, "extends"),
    "an alias of itself": ("task: &a [*a]", "task"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_file_is_refused_at_once_in_one_line_with_its_place(kind, tmp_path, capsys):
    text, problem = HOSTILE[kind]
    file = tmp_path / "a.yaml"
    file.write_text(text)
    began = time.monotonic()
    with pytest.raises(SystemExit) as ended:
        main(["config", "check", str(file)])
    said = capsys.readouterr().err
    assert ended.value.code == 2 and time.monotonic() - began < 5
    assert problem in said and "a.yaml" in said and all(len(line) < 5_000 for line in said.splitlines())


def test_a_nested_value_on_the_command_line_is_refused_too(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["config", "show", "--set", "task=" + "[" * 10_000])
    assert ended.value.code == 2 and "levels deep" in capsys.readouterr().err


@pytest.mark.parametrize("key", ["task", "llm.backend", "run.video", "seed", "skillbook.url"])
def test_a_secret_that_stands_where_none_belongs_is_not_printed(key, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret-0123456789")
    monkeypatch.chdir(tmp_path)
    for command in (["run"], ["config", "check"], ["config", "show"]):
        with pytest.raises(SystemExit):
            main([*command, "--set", f"{key}=${{oc.env:OPENAI_API_KEY}}"])
        said = capsys.readouterr()
        assert "sk-secret" not in said.out + said.err


def test_ordinary_aliases_and_references_still_work(tmp_path, capsys):
    file = tmp_path / "a.yaml"
    file.write_text("task: put-the-cube-away\nseed: 3\nrun: {retries: '${seed}'}\n")
    with pytest.raises(SystemExit) as ended:
        main(["config", "check", str(file)])
    assert ended.value.code == 0, capsys.readouterr().err
