"""Merging templates of different keys into one function, without a language model, if only defaults tell them apart."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import chain, count, takewhile

import attrs

from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import GeneralFunction, as_template, read_function, with_header

_UNREADABLE = (ValueError, TypeError, SyntaxError, RecursionError, MemoryError)


@attrs.frozen(eq=False)
class _Template:
    entry: Entry
    function: ast.FunctionDef
    values: dict[str, str]  # the default of each parameter as a literal, in the order of the signature
    shape: str  # equal for templates that may be merged


def merge_by_defaults(
    templates: Sequence[Entry], actions: Actions, taken: Collection[str] = ()
) -> list[GeneralFunction]:
    """Merge templates of at least two keys whose code is equal but for name, docstring, annotations and defaults.

    The function has the newest template's body and annotations, and the commonest name, docstring and defaults (the
    newest on a tie). A parameter whose value is a different string in each template, such as the name of a thing, has
    no default if it is keyword-only or no positional parameter before it has one. Left out are templates that have a
    parameter without a literal default or that mention their own name.

    Args:
        templates: valid templates, each with its own id.
        actions: table of synonyms; only templates whose actions have the same canonical verb are merged.
        taken: names that no function may get, such as those of skills and of other functions.

    Returns:
        The functions with their calls, in the order of their smallest id. ``as_template`` makes each template's code
        from its call again, but for name, docstring, annotations, comments and layout; code and calls together are
        shorter than the templates.
    """
    groups: dict[tuple[str, str], list[_Template]] = {}
    for entry in sorted(templates, key=lambda one: one.id):
        if (template := _read(entry)) is not None:
            groups.setdefault((actions.canonical(entry.key.action), template.shape), []).append(template)
    names, merges = set(taken), []
    for group in groups.values():
        if len({one.entry.key for one in group}) > 1 and (merge := _merged(group, names)) is not None:
            merges.append(merge)
            names.add(read_function(merge.code).name)
    return merges


def _read(entry: Entry) -> _Template | None:
    try:
        read_function(entry.text)
        function = _function(ast.parse(entry.text))
        defaults = [*function.args.defaults, *function.args.kw_defaults]
        parameters = [*_positional(function.args), *(arg.arg for arg in function.args.kwonlyargs)]
        values = dict(zip(parameters, map(_literal, defaults), strict=True))  # strict: every one has a default
        plain = _plain(entry.text)
        _function(plain).args.defaults, _function(plain).args.kw_defaults = [], []
        shape = ast.dump(plain)
    except _UNREADABLE:
        return None
    return None if function.name in _used(function) else _Template(entry, function, values, shape)


def _merged(group: Sequence[_Template], taken: Collection[str]) -> GeneralFunction | None:
    """The function and calls of templates in ascending order of ids, or None if they would not replace them."""
    newest = group[-1]
    common = _commonest([one.function.name for one in group])
    names = chain([common], (f"{common}_{number}" for number in count(2)))
    name = next(one for one in names if one not in taken and one not in _used(newest.function))
    defaults = _defaults(group)
    try:
        code = _code(newest, name, _docstring(group), defaults)
        calls = [(one.entry.id, _call(name, one, defaults)) for one in group]
        same = all(
            ast.dump(_plain(as_template(code, call))) == ast.dump(_plain(one.entry.text))
            for one, (_, call) in zip(group, calls, strict=True)
        )
    except _UNREADABLE:
        return None
    shorter = len(code) + sum(len(call) for _, call in calls) < sum(len(one.entry.text) for one in group)
    return GeneralFunction(code, tuple(calls)) if same and shorter else None


def _defaults(group: Sequence[_Template]) -> dict[str, str]:
    """The defaults of the function; parameters that are to have none are missing."""
    values = {name: [one.values[name] for one in group] for name in group[0].values}
    args = group[0].function.args

    def names_a_thing(parameter: str) -> bool:
        given = values[parameter]
        return len(set(given)) == len(given) and all(one[0] in "'\"" for one in given)

    required = set(takewhile(names_a_thing, _positional(args)))
    required |= {arg.arg for arg in args.kwonlyargs if names_a_thing(arg.arg)}
    return {name: _commonest(given) for name, given in values.items() if name not in required}


def _code(newest: _Template, name: str, docstring: str, defaults: Mapping[str, str]) -> str:
    """The newest template's code with another name, docstring and defaults."""
    text = newest.entry.text
    old, lines = newest.function.body[0], text.splitlines(keepends=True)
    indentation = lines[old.lineno - 1].encode()[: old.col_offset].decode()
    rest = lines[(old.end_lineno or 0) - 1].encode()[old.end_col_offset :].decode()
    described = "".join([*lines[: old.lineno - 1], indentation, docstring, rest, *lines[old.end_lineno :]])
    function = _function(ast.parse(text))
    function.name, args = name, function.args
    literals = {parameter: ast.parse(value, mode="eval").body for parameter, value in defaults.items()}
    args.defaults = [literals[parameter] for parameter in _positional(args) if parameter in literals]
    args.kw_defaults = [literals.get(arg.arg) for arg in args.kwonlyargs]
    return with_header(described, function)


def _call(name: str, template: _Template, defaults: Mapping[str, str]) -> str:
    """The call with what differs from the defaults: by position as far as the signature demands, else by keyword."""
    args, values = template.function.args, template.values
    by_position = [*args.posonlyargs, *(arg for arg in args.args if arg.arg not in defaults)]
    differing = [parameter for parameter, value in values.items() if defaults.get(parameter) != value]
    last = max((place for place, arg in enumerate(by_position) if arg.arg in differing), default=-1)
    positional = [arg.arg for arg in by_position[: last + 1]]
    keywords = [f"{parameter}={values[parameter]}" for parameter in differing if parameter not in positional]
    return f"{name}({', '.join([*(values[parameter] for parameter in positional), *keywords])})"


def _docstring(group: Sequence[_Template]) -> str:
    """The commonest docstring as it stands in the newest template that has it, with quotes."""
    docstrings = [ast.get_docstring(one.function) or "" for one in group]
    newest = max(place for place, one in enumerate(docstrings) if one == _commonest(docstrings))
    return ast.get_source_segment(group[newest].entry.text, group[newest].function.body[0]) or ""


def _plain(code: str) -> ast.Module:
    """The code's tree without its function's name, docstring and annotations."""
    tree = ast.parse(code)
    function = _function(tree)
    function.name, function.returns, function.body = "", None, function.body[1:]
    for arg in ast.walk(function.args):
        if isinstance(arg, ast.arg):
            arg.annotation = None
    return tree


def _literal(default: ast.expr | None) -> str:
    """``repr`` of a default, if it stands for the same tree. A set does not: its order changes from run to run."""
    if default is None or any(isinstance(node, ast.Set) for node in ast.walk(default)):
        raise ValueError("no default, or a set")
    text = repr(ast.literal_eval(default))
    if ast.dump(ast.parse(text, mode="eval").body) != ast.dump(default):
        raise ValueError(f"{text} is written otherwise")
    return text


def _function(tree: ast.Module) -> ast.FunctionDef:
    return next(node for node in tree.body if isinstance(node, ast.FunctionDef))


def _positional(args: ast.arguments) -> list[str]:
    return [arg.arg for arg in chain(args.posonlyargs, args.args)]


def _used(function: ast.FunctionDef) -> set[str]:
    return {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}


def _commonest(values: Sequence[str]) -> str:
    """The most frequent value, the last one on a tie."""
    return max(reversed(values), key=Counter(values).__getitem__)
