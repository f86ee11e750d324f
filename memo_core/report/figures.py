"""The figures of a report: matplotlib, as SVG and PNG. Each says which language backend made it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.report.findings import Findings
from memo_core.report.statistics import Interval, Outcomes, interval, performance_profile
from memo_core.report.tables import rate_of
from memo_core.skillbook.stats import Growth

COLOURS = {"memo": "#0072b2", "memo-c": "#56b4e9", "memo-s": "#7f7f7f", "droc-v": "#d55e00"}  # safe for colour-blind
MARKERS = {"memo": "o", "memo-c": "s", "memo-s": "", "droc-v": "^"}
FURTHER = ("#009e73", "#cc79a7", "#e69f00", "#000000")  # of plugins' methods, in order
LINE_WIDTHS = {"memo": 5.0, "memo-c": 3.0, "droc-v": 1.3}
DOTS_PER_INCH = 150


@attrs.frozen(eq=False)
class Figure:
    """One figure: files beside the page, and what it shows in words."""

    name: str
    title: str
    svg: Path
    png: Path


def all_figures(findings: Findings, folder: Path) -> list[Figure]:
    """Draw all figures for which there is something into ``folder``. Raises ``ImportError`` without matplotlib."""
    makers: tuple[tuple[str, str, Callable[[Findings, Any], bool]], ...] = (
        ("figure-3-hours", "Figure 3: success by hours of teaching, zero-shot", _by_hours),
        ("figure-4-tasks", "Figure 4: success by task and method, largest book, zero-shot", _by_task),
        ("profiles", "Performance profiles, largest book, zero-shot", _profiles),
        ("books", "Characters of a book by hours of teaching", _books),
    )
    found = []
    for name, title, maker in makers:
        figure = _drawn(findings, folder, name, title, maker)
        if figure is not None:
            found.append(figure)
    return found


def _pyplot() -> Any:
    """Matplotlib's pyplot, drawing into files only."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _drawn(
    findings: Findings, folder: Path, name: str, title: str, maker: Callable[[Findings, Any], bool]
) -> Figure | None:
    pyplot = _pyplot()
    pyplot.rcParams["svg.hashsalt"] = name  # the same figure is the same file
    figure, axes = pyplot.subplots(figsize=(7.0, 4.2), layout="constrained")
    try:
        if not maker(findings, axes):
            return None
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_title(title, loc="left", fontsize=11, pad=18)
        figure.supxlabel(findings.made_with, fontsize=8, color="#555555")
        folder.mkdir(parents=True, exist_ok=True)
        made = Figure(name, title, folder / f"{name}.svg", folder / f"{name}.png")
        figure.savefig(made.svg, metadata={"Date": None})
        figure.savefig(made.png, dpi=DOTS_PER_INCH)
        return made
    finally:
        pyplot.close(figure)


def _by_hours(findings: Findings, axes: Any) -> bool:
    """A line a method with its interval; a level one for a method without memory."""
    shown = False
    for method in findings.methods:
        rows = findings.zero_shot(method=method, given="")
        style = {"color": _colour(findings, method), "label": f"{method} ({len(rows)} trials)"}
        level = [row for row in rows if row["hours"] is None]
        if level:
            rate = rate_of(level)
            axes.axhline(100 * rate.value, linestyle="--", linewidth=1.5, **style)
            axes.axhspan(100 * rate.low, 100 * rate.high, color=style["color"], alpha=0.08)
            shown = True
        hours = sorted({row["hours"] for row in rows if row["hours"] is not None})
        if hours:
            rates = [rate_of([row for row in rows if row["hours"] == hour]) for hour in hours]
            width = LINE_WIDTHS.get(method, 1.5)  # lines that lie on each other can be told apart
            values = [100 * rate.value for rate in rates]
            axes.plot(hours, values, marker=MARKERS.get(method, "o"), markersize=3 + width, linewidth=width, **style)
            low, high = [100 * rate.low for rate in rates], [100 * rate.high for rate in rates]
            axes.fill_between(hours, low, high, color=style["color"], alpha=0.15)
            shown = True
    axes.set(xlabel="hours of teaching", ylabel="success, %", ylim=(-3, 103))
    if shown:
        axes.legend(frameon=False, fontsize=9)
    return shown


def _by_task(findings: Findings, axes: Any) -> bool:
    tasks, methods = findings.tasks, findings.methods
    if not tasks or not findings.zero_shot():
        return False
    width = 0.8 / max(1, len(methods))
    for place, method in enumerate(methods):
        rates = [rate_of([row for row in findings.largest(method) if row["task"] == task]) for task in tasks]
        at = np.arange(len(tasks)) + (place - (len(methods) - 1) / 2) * width
        heights = [0.0 if np.isnan(rate.value) else 100 * rate.value for rate in rates]
        label = f"{method} ({len(findings.largest(method))} trials)"
        axes.bar(at, heights, width, label=label, color=_colour(findings, method), yerr=_errors(rates), capsize=2)
    axes.set_xticks(range(len(tasks)), [task.replace("-", " ") for task in tasks], rotation=18, ha="right", fontsize=8)
    axes.set(ylabel="success, %", ylim=(0, 103))
    below_title = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.0, "borderpad": 0.2}
    axes.legend(frameon=False, fontsize=9, ncols=len(methods), **below_title)
    return True


def _colour(findings: Findings, method: str) -> str:
    others = [name for name in findings.methods if name not in COLOURS]
    return COLOURS.get(method) or FURTHER[others.index(method) % len(FURTHER) if method in others else -1]


def _errors(rates: list[Interval]) -> Any:
    low = [100 * (rate.value - rate.low) for rate in rates]
    high = [100 * (rate.high - rate.value) for rate in rates]
    return np.maximum(np.nan_to_num([low, high]), 0.0)


def _profiles(findings: Findings, axes: Any) -> bool:
    """Share of tasks and histories with a success rate above each threshold, as rliable draws it."""
    thresholds = np.linspace(0.0, 0.99, 34)
    shown = False
    for method in findings.methods:
        outcomes = Outcomes.of(findings.largest(method))
        if not outcomes.trials:
            continue
        shares = performance_profile(outcomes, thresholds)
        bands = [_share_above(outcomes, threshold) for threshold in thresholds[::3]]
        colour = _colour(findings, method)
        axes.step(
            100 * thresholds,
            100 * shares,
            where="post",
            color=colour,
            linewidth=LINE_WIDTHS.get(method, 1.5),
            label=f"{method} ({outcomes.trials} trials)",
        )
        low, high = [100 * band.low for band in bands], [100 * band.high for band in bands]
        axes.fill_between(100 * thresholds[::3], low, high, step="post", color=colour, alpha=0.1)
        shown = True
    axes.set(xlabel="success rate over scenes, more than, %", ylabel="share of tasks and histories, %", ylim=(-3, 103))
    if shown:
        axes.legend(frameon=False, fontsize=9)
    return shown


def _share_above(outcomes: Outcomes, threshold: float) -> Interval:
    return interval(
        [outcomes], lambda drawn: float(performance_profile(drawn, np.array([threshold]))[0]), resamples=200
    )


def _books(findings: Findings, axes: Any) -> bool:
    told = {"memo-c": "before clustering (memo-c)", "memo": "after clustering (memo)"}
    shown = False
    for method in dict.fromkeys((*told, *(book["method"] for book in findings.books))):
        of = [book for book in findings.books if book["method"] == method and not book["ablation"]]
        hours = sorted({book["hours"] for book in of})
        if len(hours) > 1:
            sizes = [[book["characters"] for book in of if book["hours"] == hour] for hour in hours]
            style = {"marker": MARKERS.get(method, "o"), "label": told.get(method, method)}
            colour = _colour(findings, method)
            axes.plot(hours, [np.mean(size) for size in sizes], color=colour, **style)
            axes.fill_between(
                hours, [min(size) for size in sizes], [max(size) for size in sizes], color=colour, alpha=0.12
            )
            shown = True
    axes.set(xlabel="hours of teaching", ylabel="characters; band: all histories")
    if shown:
        axes.legend(frameon=False, fontsize=9)
    return shown


def draw_growth(growth: Sequence[Growth], file: Path) -> None:
    """Draw how a book grew: entries and characters above, functions and the share of subtasks done by a call below.

    Args:
        growth: the book after each revision.
        file: .png or .svg.

    Raises:
        ImportError: without matplotlib.
        InvalidArgument: if the file's ending is another, or it cannot be written.
    """
    if file.suffix not in (".png", ".svg"):
        raise InvalidArgument("--plot", f"{file.name} is neither .png nor .svg", "a file that ends in one of these")
    pyplot = _pyplot()
    figure, (above, below) = pyplot.subplots(2, 1, figsize=(7.0, 5.0), layout="constrained", sharex=True)
    steps = range(1, len(growth) + 1)
    above.step(steps, [one.characters for one in growth], where="post", color=COLOURS["memo"], label="characters")
    above.set(ylabel="characters", title="the book after each revision")
    beside = above.twinx()
    beside.step(steps, [one.entries for one in growth], where="post", color=COLOURS["memo-c"], label="entries")
    beside.set(ylabel="entries")
    figure.legend(frameon=False, fontsize=9, loc="outside upper right")
    share = [math.nan if one.by_call is None else 100 * one.by_call for one in growth]
    below.step(steps, share, where="post", color=COLOURS["memo"])
    below.set(xlabel="revision", ylabel="% of approved subtasks\ndone by a call", ylim=(-2, 102))
    functions = below.twinx()
    functions.step(steps, [one.functions for one in growth], where="post", color=COLOURS["memo-c"])
    functions.set(ylabel="functions")
    for counted in (beside.yaxis, below.xaxis, functions.yaxis):
        counted.get_major_locator().set_params(integer=True)
    try:
        figure.savefig(file, dpi=DOTS_PER_INCH, metadata={"Date": None} if file.suffix == ".svg" else None)
    except OSError as error:
        raise InvalidArgument("--plot", f"{file}: {error.strerror}", "a file that can be written") from None
    finally:
        pyplot.close(figure)
