"""Reading YAML with the file and line of every value and without implicit conversions.

The scalars are those of YAML 1.2: ``true``/``false`` are the only booleans (so ``no`` is a string), ``1e-3`` is a
number, ``010``, ``1:30`` and dates are text.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.config.errors import Issue, Origin, dotted
from memo_core.text.parsing import read_at_most

Path_ = tuple[str | int, ...]


DEEPEST = 40  # levels of lists and mappings; an experiment has five
_MOST_BYTES = 4 << 20  # of one file
MOST_VALUES = 100_000  # in one file, those behind its aliases counted each time


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # no types are published
    """Limits the number of nodes and the depth, because nested aliases grow without bound and nesting is read
    recursively."""

    yaml_implicit_resolvers: dict[str, Any] = {}

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0
        self._values = 0
        self._sizes: dict[int, int] = {}  # id of a node -> values in it

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        mark, alias, before = self.peek_event().start_mark, self.check_event(yaml.AliasEvent), self._values
        self._depth += 1
        if self._depth > DEEPEST:
            raise yaml.composer.ComposerError(None, None, f"nested more than {DEEPEST} levels deep", mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        self._values += self._sizes.get(id(node), 1) if alias else 1
        self._sizes.setdefault(id(node), self._values - before)
        if self._values > MOST_VALUES:
            problem = f"more than {MOST_VALUES} values, those behind aliases included"
            raise yaml.composer.ComposerError(None, None, problem, mark)
        return node


_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"^(?:true|True|false|False)$"), list("tTfF"))
_Loader.add_implicit_resolver("tag:yaml.org,2002:int", re.compile(r"^[-+]?(?:0|[1-9][0-9_]*)$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^[-+]?(?:(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+|\.(?:inf|Inf|nan|NaN))$"
    ),
    list("-+0123456789."),
)
_Loader.add_implicit_resolver("tag:yaml.org,2002:null", re.compile(r"^(?:~|null|Null|)$"), ["~", "n", "N", ""])
_Loader.add_implicit_resolver("tag:yaml.org,2002:merge", re.compile(r"^<<$"), ["<"])


@attrs.define
class Source:
    """One layer of an experiment: plain values, their origins, errors, and what ``--set`` gives a path before it is
    read as YAML."""

    values: dict[str, Any] = attrs.field(factory=dict)
    origins: dict[Path_, Origin] = attrs.field(factory=dict)
    issues: list[Issue] = attrs.field(factory=list)
    typed: dict[Path_, str] = attrs.field(factory=dict)


def read_file(file: Path, shown: str) -> Source:
    """Read one file; ``shown`` is its name in messages. Does not raise: errors are in ``issues``."""
    whole = Origin(shown)
    try:
        text = read_at_most(file, _MOST_BYTES).decode("utf-8")
    except FileNotFoundError:
        return Source(issues=[Issue(whole, "", "there is no such file")])
    except UnicodeDecodeError:
        return Source(issues=[Issue(whole, "", "is not UTF-8 text")])
    except ValueError as error:
        return Source(issues=[Issue(whole, "", str(error))])
    except OSError as error:
        return Source(issues=[Issue(whole, "", f"cannot be read: {error.strerror or error}")])
    return read_text(text, shown)


def read_text(text: str, shown: str) -> Source:
    """Read YAML text; see ``read_file``."""
    source = Source()
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
    except yaml.YAMLError as error:
        return Source(issues=[_syntax_issue(error, shown)])
    if node is None:
        return source
    if not isinstance(node, yaml.MappingNode):
        problem = "must hold `section: …` lines at its top level"
        return Source(issues=[Issue(Origin(shown, node.start_mark.line + 1), "", problem)])
    _Reading(loader, shown, source).mapping(node, (), source.values)
    return source


def read_value(text: str) -> Any:
    """One YAML value, as after ``--set key=``. Raises ``ValueError`` with the reason."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise ValueError(getattr(error, "problem", None) or str(error)) from None


# Pieces of PyYAML's messages for the mistakes that people make most, and what to look for.
_IN_PLAIN_WORDS = {
    "mapping values are not allowed": "a second `key:` in one line, or a line indented further than its section",
    "expected <block end>": "this line is not indented as the lines of its section are, or a bracket or quote is open",
    "could not find expected ':'": "a line without `key: value`, or this line is indented less than its section",
    "cannot start any token": "a tab or a character that means something in YAML: indent with spaces, quote such text",
}


def _syntax_issue(error: yaml.YAMLError, shown: str) -> Issue:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or " ".join(str(error).split())
    context = getattr(error, "context", None)
    said = f"not YAML: {problem}" + (f" {context}" if context else "")
    if plain := next((words for piece, words in _IN_PLAIN_WORDS.items() if piece in said), ""):
        said = f"not YAML: {plain}"
    return Issue(Origin(shown, mark.line + 1 if mark else None), "", said)


class _Reading:
    """Walks a node tree, so that duplicate keys and line numbers are not lost as in plain loading."""

    def __init__(self, loader: yaml.SafeLoader, shown: str, source: Source) -> None:
        self._loader = loader
        self._shown = shown
        self._source = source
        self._open: set[int] = set()

    def mapping(self, node: yaml.MappingNode, path: Path_, into: dict[str, Any]) -> None:
        first: dict[str, int] = {}
        for key, _ in node.value:
            name, line = str(key.value), key.start_mark.line + 1
            if name in first and name != "<<":
                self._issue(key, (*path, name), f"given twice (first in line {first[name]})")
            first.setdefault(name, line)
        try:
            self._loader.flatten_mapping(node)
        except yaml.YAMLError as error:
            self._source.issues.append(_syntax_issue(error, self._shown))
            return
        for key, child in node.value:
            if not isinstance(key, yaml.ScalarNode):
                self._issue(key, path, "a key must be a word")
                continue
            here = (*path, str(key.value))
            self._source.origins[here] = Origin(self._shown, key.start_mark.line + 1)
            into[str(key.value)] = self._value(child, here)

    def _value(self, node: yaml.Node, path: Path_) -> Any:
        if id(node) in self._open:
            self._issue(node, path, "an alias may not contain itself")
            return None
        self._open.add(id(node))
        try:
            if isinstance(node, yaml.MappingNode):
                mapping: dict[str, Any] = {}
                self.mapping(node, path, mapping)
                return mapping
            if isinstance(node, yaml.SequenceNode):
                values = []
                for index, item in enumerate(node.value):
                    here = (*path, index)
                    self._source.origins[here] = Origin(self._shown, item.start_mark.line + 1)
                    values.append(self._value(item, here))
                return values
            try:
                return self._loader.construct_object(node)
            except (yaml.YAMLError, ValueError) as error:
                self._issue(node, path, f"not YAML: {getattr(error, 'problem', None) or error}")
                return None
            except (
                AttributeError,
                LookupError,
            ):  # as PyYAML for `!!timestamp soon`, `!!bool maybe` and `!!int` of nothing
                self._issue(node, path, f"not YAML: it does not fit its tag {node.tag}")
                return None
        finally:
            self._open.discard(id(node))

    def _issue(self, node: yaml.Node, path: Path_, problem: str) -> None:
        self._source.issues.append(Issue(Origin(self._shown, node.start_mark.line + 1), dotted(path), problem))
