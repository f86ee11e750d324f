"""Two evaluations side by side: what differs in their settings, and the rates of what both have tried."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.errors import InvalidArgument
from memo_core.evaluation.evaluating import CODE, methods_of
from memo_core.evaluation.table import ERRORS, book_name, has_memory, read_table
from memo_core.report.made_with import made_with
from memo_core.report.separation import extreme
from memo_core.report.statistics import Interval, Outcomes, difference, interval
from memo_core.report.tables import rate_of
from memo_core.runs.folder import flat
from memo_core.study.study import CONFIG
from memo_core.text.parsing import resolved

_PLACES = ("run.study_ledger",)  # settings that name the experiment's own folder
_CODE = "code of MEMO and plugins (digest)"
ALL = "all"  # tasks that both have, together
Rows = list[dict[str, Any]]
Key = tuple[str, str, str]


@attrs.frozen(eq=False)
class Evaluation:
    """One of the two evaluations. ``settings`` by dotted path; ``rows`` are trials without ablations."""

    folder: Path
    settings: Mapping[str, Any]
    suite: str
    made_with: str
    rows: Rows
    errors: int  # trials that could not be carried out

    def summary(self) -> dict[str, Any]:
        """Its folder, backends, trials and errors."""
        return {
            "folder": str(self.folder),
            "made_with": self.made_with,
            "trials": len(self.rows),
            "errors": self.errors,
        }


@attrs.frozen
class Rate:
    """The success rates of both evaluations for one method, mode, skillbook and task. ``book`` is the hours of teaching
    or a given skillbook's name, empty for a method without; ``difference`` is that of B minus A over the ``pairs`` of
    trials in the same scene, None where there are none."""

    method: str
    mode: str
    book: str
    task: str
    a: Interval
    b: Interval
    difference: Interval | None
    pairs: int


@attrs.frozen(eq=False)
class Comparison:
    """The result of ``memo report --compare``. ``differing``: setting, value in A, value in B."""

    a: Evaluation
    b: Evaluation
    differing: tuple[tuple[str, Any, Any], ...]
    rates: tuple[Rate, ...]
    notes: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """The document that ``memo report --compare A B --json`` prints."""
        return {
            "a": self.a.summary(),
            "b": self.b.summary(),
            "settings": [{"path": path, "a": a, "b": b} for path, a, b in self.differing],
            "rates": [attrs.asdict(rate) for rate in self.rates],
            "notes": list(self.notes),
        }


def compare(folder_a: Path, folder_b: Path) -> Comparison:
    """Compare two evaluations.

    Compared are trials of the same method, mode and kind of skillbook (of the hours that both have, the most; given
    ones by name) at the tasks that both have. Ablations are left out.

    Args:
        folder_a: folder of an experiment with an evaluation.
        folder_b: another one.

    Returns:
        The settings that differ, rates with intervals, and paired differences.

    Raises:
        InvalidArgument: if a folder holds no evaluation, both are the same, or they have nothing in common.
    """
    if resolved(folder_a) == resolved(folder_b):
        raise InvalidArgument("--compare", f"{folder_a} twice", "the folders of two evaluations")
    a, b = _read(folder_a), _read(folder_b)
    rates = tuple(_rates(a, b))
    notes = (*_one_sided(a, b), *_not_compared(a, b, rates), *_not_separating(rates), *_unpaired(a, b))
    if not rates:
        problem = f"nothing in common: {folder_a} has {_told(a)}; {folder_b} has {_told(b)}"
        reasons = "".join(f"; {note}" for note in _memory_differs(a, b))
        raise InvalidArgument("--compare", problem + reasons, "the same method, skillbook and task in both")
    return Comparison(a, b, tuple(_differing(a, b)), rates, notes)


# -- reading -----------------------------------------------------------------------------------------------------------
def _read(folder: Path) -> Evaluation:
    evaluation = folder / "evaluation"
    if not (evaluation / CONFIG).exists():
        expected = "the --out of memo evaluate or memo reproduce"
        raise InvalidArgument("--compare", f"{folder} holds no evaluation", expected)
    settings, suite = _settings(evaluation / CONFIG)
    rows = [row for row in read_table(evaluation) if not row["ablation"]]
    if not rows:
        problem = f"no trial of the evaluation in {folder} is over"
        raise InvalidArgument("--compare", problem, "memo evaluate first, which goes on with it")
    errors = len(read_table(evaluation, ERRORS))
    return Evaluation(folder, _settings_by_path(settings, evaluation), suite, made_with(settings), rows, errors)


def _settings(file: Path) -> tuple[dict[str, Any], str]:
    """The settings of an evaluation, and its suite."""
    try:
        settings = yaml.safe_load(file.read_text(encoding="utf-8"))
        return settings, str(settings["suite"]["backend"])
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        problem = f"{file} cannot be read ({type(error).__name__})"
        raise InvalidArgument("--compare", problem, "the file as memo evaluate wrote it") from None


def _settings_by_path(settings: dict[str, Any], evaluation: Path) -> dict[str, Any]:
    by_method = {**settings, "evaluation": {**settings.get("evaluation", {}), "methods": methods_of(settings)}}
    values = {path: value for path, value in flat(by_method).items() if path not in _PLACES}
    file = evaluation / CODE
    return values | ({_CODE: file.read_text(encoding="utf-8").strip()} if file.exists() else {})


def _differing(a: Evaluation, b: Evaluation) -> Iterator[tuple[str, Any, Any]]:
    for path in dict.fromkeys((*a.settings, *b.settings)):
        if a.settings.get(path) != b.settings.get(path):
            yield path, a.settings.get(path), b.settings.get(path)


# -- rates -------------------------------------------------------------------------------------------------------------
def _rates(a: Evaluation, b: Evaluation) -> Iterator[Rate]:
    of_a, of_b = _by_key(a), _by_key(b)
    for key in _common(of_a, of_b):
        tasks = [task for task in dict.fromkeys(row["task"] for row in of_a[key]) if _at(of_b[key], [task])]
        together = [(ALL, tasks)] if len(tasks) > 1 else []
        for name, wanted in (*together, *((task, [task]) for task in tasks)):
            yield _rate(key, name, _at(of_a[key], wanted), _at(of_b[key], wanted), a.suite == b.suite)


def _by_key(evaluation: Evaluation) -> dict[Key, Rows]:
    """Trials by method, mode and skillbook."""
    found: dict[Key, Rows] = {}
    for row in evaluation.rows:
        found.setdefault((row["method"], row["mode"], book_name(row)), []).append(row)
    return found


def _common(of_a: Mapping[Key, Rows], of_b: Mapping[Key, Rows]) -> list[Key]:
    """The keys that both have, of several hours the most."""
    both = [key for key in of_a if key in of_b]
    hours = {key: of_a[key][0]["hours"] for key in both}
    most: dict[tuple[str, str], float] = {}
    for (method, mode, _), hour in hours.items():
        most[method, mode] = max(most.get((method, mode), 0.0), hour or 0.0)
    return [key for key in both if hours[key] in (None, most[key[:2]])]


def _at(rows: Rows, tasks: Sequence[str]) -> Rows:
    return [row for row in rows if row["task"] in tasks]


def _rate(key: Key, task: str, rows_a: Rows, rows_b: Rows, same_scenes: bool) -> Rate:
    both = {_scene(row) for row in rows_a} & {_scene(row) for row in rows_b} if same_scenes else set()
    paired = [Outcomes.of([row for row in rows if _scene(row) in both]) for rows in (rows_b, rows_a)]
    rate_a, rate_b = (attrs.evolve(rate_of(rows), trials=len(rows)) for rows in (rows_a, rows_b))
    change = interval(paired, difference) if both else None
    method, mode, book = key
    return Rate(method, mode, book, task, rate_a, rate_b, change, len(both))


def _scene(row: dict[str, Any]) -> tuple[str, int, int]:
    return row["task"], row["scene"], row["number"]


# -- what cannot be compared, or says nothing --------------------------------------------------------------------------
def _one_sided(a: Evaluation, b: Evaluation) -> Iterator[str]:
    modes = [{(row["method"], row["mode"]) for row in one.rows} for one in (a, b)]
    for name, here, there in (("A", modes[0], modes[1]), ("B", modes[1], modes[0])):
        if only := sorted(here - there):
            yield f"only in {name}: {', '.join(f'{method} {mode}' for method, mode in only)}"


def _not_compared(a: Evaluation, b: Evaluation, rates: Sequence[Rate]) -> Iterator[str]:
    """Methods that both have tried, with other skillbooks or at other tasks."""
    yield from _memory_differs(a, b)
    compared = {(rate.method, rate.mode) for rate in rates}
    books: list[dict[tuple[str, str], list[str]]] = [{}, {}]
    for found, one in zip(books, (a, b), strict=True):
        for row in one.rows:
            found.setdefault((row["method"], row["mode"]), []).append(book_name(row) or "no skillbook")
    for key in books[0].keys() & books[1].keys() - compared:
        of_a, of_b = (", ".join(dict.fromkeys(found[key])) for found in books)
        yield f"{' '.join(key)} has no skillbook and task in common: {of_a} in A, {of_b} in B"


def _memory_differs(a: Evaluation, b: Evaluation) -> Iterator[str]:
    kinds = [{row["method"]: has_memory(row) for row in one.rows} for one in (a, b)]
    for method in kinds[0]:
        if method in kinds[1] and kinds[0][method] != kinds[1][method]:
            where = ("A", "B") if kinds[0][method] else ("B", "A")
            yield f"{method} has a skillbook in {where[0]} and none in {where[1]}: these are not compared"


def _not_separating(rates: Sequence[Rate]) -> Iterator[str]:
    first = {(rate.method, rate.mode, rate.book): rate for rate in reversed(rates)}  # all tasks, or the only one
    for rate in reversed(first.values()):
        if at := extreme([rate.a.value, rate.b.value]):
            yield f"{rate.method} {rate.mode}: both evaluations are at the {at}, so that their rates separate nothing"


def _unpaired(a: Evaluation, b: Evaluation) -> Iterator[str]:
    if a.suite != b.suite:
        yield f"no differences: the scenes of the suites {a.suite} and {b.suite} are not the same"


def _told(evaluation: Evaluation) -> str:
    methods = dict.fromkeys(f"{row['method']} {row['mode']} {book_name(row)}".strip() for row in evaluation.rows)
    return f"{', '.join(methods)} at {', '.join(dict.fromkeys(row['task'] for row in evaluation.rows))}"
