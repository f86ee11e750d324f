"""Experiment and prompt files: values of the wrong kind, references, aliases, nesting, templates that run code."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import Raw, damaged_bytes, damaged_text, damaged_value, text

REFERENCES = (
    "${oc.env:FUZZ_API_KEY}",
    "${oc.env:FUZZ_API_KEY,x}",
    "a${oc.env:FUZZ_API_KEY}b",
    "${oc.decode:${oc.env:FUZZ_API_KEY}}",
    "${oc.decode:'{a: ${oc.env:FUZZ_API_KEY}}'}",
    "${oc.create:{a: ${oc.env:FUZZ_API_KEY}}}",
    "${oc.select:llm}",
    "${oc.dict.keys:llm}",
    "${oc.dict.values:run}",
    "${oc.deprecated:task}",
    "${oc.env:${task}}",
    "${task}",
    "${..task}",
    "${llm.${task}}",
    "${x",
    "${}",
    "${" * 30 + "x" + "}" * 30,
    "${unknown:1}",
    "${oc.decode:'[1, 2'}",
    "\\${task}",
    "???",
)
TAGS = (
    "!!python/object/apply:os.system ['true']",
    "!!python/name:os.system",
    "!!binary aGVsbG8=",
    "!!set {a, b}",
    "!!omap [a: 1]",
    "!!timestamp 2026-01-01",
    "!!float .nan",
    "!!int 99999999999999999999999",
    "!unknown x",
    "&a [*a]",
    "*nowhere",
    "|\n  a\n b",
    "? [a, b]\n: c",
    "{<<: [1, 2]}",
    "'unfinished",
    "\t- x",
    "---\nx",
)
EXPRESSIONS = (
    "{{ task }}",
    "{{ cycler.__init__.__globals__.os.popen('true').read() }}",
    "{{ ''.__class__.__mro__[1].__subclasses__() }}",
    "{{ task|attr('__class__') }}",
    "{{ [task]|map(attribute='__class__')|list }}",
    "{{ 'x' * 10 ** 10 }}",
    "{{ 'x'|center(10 ** 10) }}",
    "{{ ('%' ~ 10 ** 9 ~ 'd')|format(1) }}",
    "{{ range(10 ** 9)|list }}",
    "{% for a in range(10 ** 5) %}{% for b in range(10 ** 5) %}x{% endfor %}{% endfor %}",
    "{% set x = [] %}{% for a in range(100) %}{% set x = [x, x] %}{% endfor %}{{ x }}",
    "{% macro m() %}{{ m() }}{% endmacro %}{{ m() }}",
    "{% include 'plan.md.j2' %}",
    "{% extends 'code.md.j2' %}",
    "{% import 'x' as y %}",
    "{% raw %}",
    "{% endfor %}",
    "{{ 10 ** 10 ** 10 }}",
    "{{ 9 ** 9 ** 9 % 7 }}",
    "{{ lipsum(n=10 ** 6) }}",
    "{{ namespace(a=1).__init__ }}",
    "{{ self }}{{ self._TemplateReference__context }}",
    "{{ task.format('{0.__class__}') }}",
    "{{ '{0.__class__.__mro__}'.format(task) }}",
    "{{ dict(a=1)|xmlattr }}{{ task|pprint }}{{ task|tojson }}",
    "{{ unknown }}",
    "{{ " + "(" * 500 + "1" + ")" * 500 + " }}",
    "{{ " + "1 + " * 5000 + "1 }}",
    "{{ " + "-" * 3000 + "1 }}",
    "{# unfinished",
)  # fmt: skip
PHASES = ("system", "plan", "code", "feedback", "template", "merge", "cluster")


class Configs(Kind):
    name = "configs"

    def prepare(self, place: Path, memo: Memo) -> None:
        shown = json.loads(memo(["config", "show", "--json"]))["values"]
        self._tree: dict[str, Any] = {}
        for value in shown:
            *parents, last = value["path"].split(".")
            branch = self._tree
            for parent in parents:
                branch = branch.setdefault(parent, {})
            branch[last] = value["value"]
        self._tree["task"] = "put-the-cube-away"
        memo(["prompts", "export", "prompts"])
        self._prompts = {file.name: file.read_text(encoding="utf-8") for file in (place / "prompts").glob("*.j2")}

    def write(self, place: Path, draw: Random) -> list[Command]:
        if draw.random() < 0.2:
            return self._prompt(place, draw)
        (place / "a.yaml").write_bytes(self._config(place, draw))
        commands: list[Command] = [["config", "check", "a.yaml"], ["config", "show", "a.yaml"]]
        return [draw.choice(commands) + (["--json"] if draw.random() < 0.2 else [])]

    def _config(self, place: Path, draw: Random) -> bytes:
        raw = Raw(draw)
        kept = draw.sample(sorted(self._tree), draw.randint(1, 6))
        tree: Any = {name: self._tree[name] for name in kept}
        if draw.random() < 0.5:
            _at_random(tree, draw, draw.choice(REFERENCES))
        if draw.random() < 0.7:
            tree = damaged_value(tree, draw, raw, draw.choice((1, 1, 2, 5)))
        written = raw.dumped(tree)  # JSON is YAML
        how = draw.random()
        if how < 0.25:
            written = _entangled(draw) + f"task: {draw.choice(TAGS)}\n"
        elif how < 0.5:
            written = "".join(f"{name}: {json.dumps(self._tree[name])}\n" for name in kept if name != "task")
            written = damaged_text(written, draw) + f"\n{draw.choice(kept)}: {draw.choice(TAGS)}\n"
        elif how < 0.6:
            (place / "b.yaml").write_bytes(written.encode("utf-8", "surrogatepass"))
            base = draw.choice(("b.yaml", "a.yaml", ".", "/dev/zero", "b.yaml/x", "~", text(draw)))
            written = f"extends: {json.dumps(base)}\nseed: 1\n"
        data = written.encode("utf-8", "surrogatepass")
        return damaged_bytes(data, draw) if draw.random() < 0.2 else data

    def _prompt(self, place: Path, draw: Random) -> list[Command]:
        name = draw.choice(sorted(self._prompts))
        written = self._prompts[name]
        at = draw.randint(0, len(written))
        written = written[:at] + draw.choice(EXPRESSIONS) + written[at:]
        if draw.random() < 0.3:
            written = damaged_text(written, draw)
        (place / name).write_bytes(written.encode("utf-8", "surrogatepass"))
        phase = name.partition(".")[0]
        setting = f"prompts.{phase if phase in PHASES else draw.choice(PHASES)}={name}"
        (place / "a.yaml").write_text("seed: 0\n")
        return [draw.choice((["config", "check", "a.yaml"], ["prompts", "list"])) + ["--set", setting]]


def _at_random(tree: dict[str, Any], draw: Random, value: str) -> None:
    branch = tree
    while True:
        key = draw.choice(sorted(branch, key=str))
        child = branch[key]
        if not isinstance(child, dict) or not child or draw.random() < 0.3:
            branch[key] = value
            return
        branch = child = branch[key] = dict(child)


def _entangled(draw: Random) -> str:
    """Aliases of aliases, merges of merges, references to references, and nesting."""
    n = draw.choice((3, 12, 30, 300))
    return draw.choice(
        (
            "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, n)),
            "a0: &a0 {k: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}\n" for i in range(1, n)),
            "a0: x\n" + "".join(f"a{i}: ${{a{i - 1}}}${{a{i - 1}}}\n" for i in range(1, n)),
            "a0: {k: x}\n" + "".join(f"a{i}: {{b: ${{a{i - 1}}}, c: ${{a{i - 1}}}}}\n" for i in range(1, n)),
            "seed: " + "[" * n * 10 + "]" * n * 10 + "\n",
            "seed: " + "{a: " * n + "1" + "}" * n + "\n",
            "".join("- " * n + "\n" for _ in range(n)),
            "".join(" " * i + f"a{i}:\n" for i in range(n)),
            f"llm: {{{', '.join(f'k{i}: {i}' for i in range(n * 10))}}}\n",
            "run: {attempts: " + "9" * n * 20 + "}\n",
            "? " * n + "a\n",
            "seed: !" + "a" * n * 100 + " 1\n",
        )
    )
