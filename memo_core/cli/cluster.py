"""``memo cluster``: condense what people taught; see ``docs/clustering.md``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.options import Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import note, print_json, progress_bar
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.llm.spending import prompt_words
from memo_core.text.terminal import console

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.policy.consolidation import Clustering, ClusterOutcome
    from memo_core.process.stop_switch import StopSwitch
    from memo_core.runs.consolidation import Spending
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.consolidation.rules import Cluster
    from memo_core.skillbook.writing.key_aliases import NearKeys


def command(
    book: Book = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Ask the model, show the changes, write nothing.")] = False,
    all_: Annotated[bool, typer.Option("--all", help="Also what has not changed since it was clustered last.")] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Go on beside running robots until Ctrl-C.")] = False,
    interval: Annotated[
        float | None, typer.Option("--interval", min=0.1, help="With --watch: seconds between looks.")
    ] = None,
    keep: Annotated[
        Path | None, typer.Option("--keep", metavar="DIR", help="A new folder for the questions and answers.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Condense what people taught into fewer notes without losing content.

    A language model gets all corrections under one key, or the general statements, with the templates related to them.
    Each cluster is stored separately; if the command is stopped, the book is valid and the next call continues.
    """
    if watch and (dry_run or all_):
        raise InvalidArgument("--watch", "beside --dry-run or --all", "one of them")
    if interval is not None and not watch:
        raise InvalidArgument("--interval", "without --watch", "both of them")
    _, experiment = load(config, overrides)
    from memo_core.runs.consolidation import Spending, check_method, clustering_of
    from memo_core.runs.factories import book_of

    check_method(experiment)
    with book_of(experiment, book, read_only=True):
        pass  # a mistyped path is an error, not a new empty book
    spending = Spending()
    with (
        stopping() as stop,
        book_of(experiment, book, read_only=dry_run) as opened,
        clustering_of(experiment, opened, spending.note, stop, keep) as clustering,
    ):
        if keep is not None and not dry_run:
            opened.note_place("run", keep)  # for memo skillbook forget
        if watch:
            _watch(experiment, opened, clustering, stop, interval, spending, json)
        else:
            _Once(opened, clustering, spending, json, dry_run).run(all_)


@attrs.define
class _Once:
    """One pass over the book. Clusters finished before an error or Ctrl-C are stored and reported."""

    book: Skillbook
    clustering: Clustering
    spending: Spending
    json: bool
    dry_run: bool
    joined: list[NearKeys] = attrs.field(factory=list)
    outcomes: list[ClusterOutcome] = attrs.field(factory=list)
    waiting: int = 0

    def run(self, unchanged: bool) -> None:
        ended: MemoError | None = None
        try:
            self._pass(unchanged)
        except MemoError as error:
            ended = error
        self._report()
        if isinstance(ended, Stopped):
            note(f"memo: stopped; {self.waiting} left; the next memo cluster continues with them")
            raise typer.Exit(INTERRUPTED)
        if ended is not None:
            raise ended

    def _pass(self, unchanged: bool) -> None:
        for near in self.clustering.near_keys():
            if not self.dry_run:
                self.clustering.join(near)
            self.joined.append(near)
        clusters = self.clustering.clusters(unchanged)
        self.waiting = len(clusters)
        with _progress(len(clusters)) as advance:
            for cluster in clusters:
                advance(cluster, 0)
                self.outcomes.append(self.clustering.condense(cluster, commit=not self.dry_run))
                self.waiting -= 1
                advance(cluster, 1)
        self.waiting = 0

    def _report(self) -> None:
        from memo_core.runs.consolidation import outcome_record

        done = self.outcomes
        totals = {
            "clusters": len(done),
            "condensed": sum(one.status == "condensed" for one in done),
            "left_as_they_were": sum(one.status in ("left", "changed") for one in done),
            "not_reached": self.waiting,
            "entries_before": sum(one.entries_before for one in done),
            "entries_after": sum(one.entries_after for one in done),
            "characters_before": sum(one.characters_before for one in done),
            "characters_after": sum(one.characters_after for one in done),
        }
        spent = self.spending.record()
        if self.json:
            joined = [{"key": str(n.spelling), "into": str(n.key), "cosine": n.cosine} for n in self.joined]
            records = [outcome_record(one) for one in done]
            print_json(
                {
                    "book": self.book.url,
                    "dry_run": self.dry_run,
                    "joined": joined,
                    **totals,
                    **spent,
                    "outcomes": records,
                }
            )
            return
        if not self.joined and not done and not self.waiting:
            print("nothing to condense")
            return
        for near in self.joined:
            would = "would be" if self.dry_run else "is"
            print(f"{near.spelling} {would} merged into {near.key} (cosine {near.cosine:.2f})")
        for one in done:
            print_outcome(one)
        verb = "would become" if self.dry_run else "became"
        print(
            f"{totals['clusters']} clusters: {totals['entries_before']} entries {verb} {totals['entries_after']}, "
            f"{totals['characters_before']} characters {totals['characters_after']}"
        )
        print(_said_of(self.spending))


def print_outcome(outcome: ClusterOutcome) -> None:
    """A cluster's changes as a diff: removed entries, why, and their replacements. Unchanged entries are counted."""
    from rich.text import Text

    shown = console(width=None if sys.stdout.isatty() else 400, highlight=False)
    cluster, proposal = outcome.cluster, outcome.proposal
    before, after = outcome.entries_before, outcome.entries_after
    characters = f"{outcome.characters_before} -> {outcome.characters_after}"
    head = f"{cluster.label}: {before} -> {after} entries, {characters} characters"
    if outcome.problem:
        head = f"{cluster.label}: {before} entries are unchanged: {outcome.problem}"
    elif outcome.status == "unchanged":
        head = f"{cluster.label}: {before} entries, nothing to condense"
    shown.print(Text(head, style="bold"))
    if outcome.duplicates:
        said = "are there once" if outcome.duplicates == 1 else "are there once each"
        shown.print(Text(f"  the same words, said {outcome.duplicates + 1} times, {said}", style="dim"))
    if proposal is None or outcome.status != "condensed":
        return
    from memo_core.skillbook.consolidation.rules import is_kept

    dropped = {gone.number for gone in proposal.dropped}
    for gone in proposal.dropped:
        member, template = cluster.members[gone.number - 1], cluster.templates[gone.template - 1].entry.id
        how = "says no more than" if gone.covered else "contradicts"
        why = f"{how} template {template}" + (f": {gone.why}" if gone.why else "")
        shown.print(Text(f"  - {member.id}: {member.text}", style="red") + Text(f"   [{why}]", style="dim"))
    changed = [one for one in proposal.entries if not is_kept(cluster, one)]
    for one in changed:
        for number in one.of:
            if number in dropped:
                continue
            member = cluster.members[number - 1]
            shown.print(Text(f"  - {member.id}: {member.text}", style="red"))
        made_of = ", ".join(str(cluster.members[number - 1].id) for number in one.of)
        shown.print(Text(f"  + {one.text}", style="green") + Text(f"   [from {made_of}]", style="dim"))
    same = len(proposal.entries) - len(changed)
    if same:
        shown.print(Text(f"  {same} unchanged", style="dim"))


def _watch(
    experiment: Experiment,
    book: Skillbook,
    clustering: Clustering,
    stop: StopSwitch,
    interval: float | None,
    spending: Spending,
    json: bool,
) -> None:
    from memo_core.policy.consolidation import ClusterOutcome
    from memo_core.runs.consolidation import outcome_record, watch
    from memo_core.skillbook.writing.key_aliases import NearKeys

    def report(news: Any) -> None:
        if isinstance(news, ClusterOutcome):
            print(dumps(outcome_record(news), ensure_ascii=False), flush=True) if json else print_outcome(news)
        elif isinstance(news, NearKeys):
            line = {"joined": str(news.spelling), "into": str(news.key), "cosine": news.cosine}
            print(dumps(line) if json else f"{news.spelling} is merged into {news.key}", flush=True)
        else:
            note(f"memo: {news}; tried again later")

    seconds = interval if interval is not None else experiment.section("clustering").interval_s
    note(f"watching {book.url}, every {seconds:g} s; Ctrl-C ends it")
    try:
        watch(book, clustering, stop, seconds, report)
    except Stopped:
        note(_said_of(spending))


def _said_of(spending: Spending) -> str:
    spent = spending.spent
    cost = "" if spent.known_cost is None else f", {spent.known_cost:.4f} USD"
    asked = prompt_words(spent.prompt_tokens, spent.cached_tokens)
    return f"{spent.calls} calls, {asked} + {spent.completion_tokens} tokens{cost}"


@contextmanager
def _progress(total: int) -> Iterator[Callable[[Cluster, int], None]]:
    with progress_bar() as bar:
        task = bar.add_task("clustering", total=total)
        yield lambda cluster, steps: bar.update(task, advance=steps, description=cluster.label)
