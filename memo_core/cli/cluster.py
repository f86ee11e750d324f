"""``memo cluster``: condense what people taught; see ``docs/consolidation.md``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
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
    from memo_core.maintenance.paired_trials import PairedTrials, Verdict
    from memo_core.policy.consolidation import Clustering, ClusterOutcome
    from memo_core.policy.generalising import GroupOutcome
    from memo_core.process.stop_switch import StopSwitch
    from memo_core.runs.consolidation import Spending
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.consolidation.rules import Cluster
    from memo_core.skillbook.functions import Consolidated
    from memo_core.skillbook.model.entries import Entry
    from memo_core.skillbook.writing.key_aliases import NearKeys


def command(
    book: Book = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Ask the model, show the changes, write nothing.")] = False,
    all_: Annotated[bool, typer.Option("--all", help="Also what has not changed since it was clustered last.")] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Go on beside running robots until Ctrl-C.")] = False,
    interval: Annotated[
        float | None, typer.Option("--interval", min=0.1, help="With --watch: seconds between looks.")
    ] = None,
    until_eof: Annotated[
        bool, typer.Option("--until-eof", help="With --watch: end when standard input ends, too.")
    ] = False,
    keep: Annotated[
        Path | None, typer.Option("--keep", metavar="DIR", help="A new folder for the questions and answers.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Condense what people taught into fewer notes and general functions without losing content.

    A language model gets all corrections under one key, or the general statements, with the templates related to them.
    Then notes with the same words become one note of several keys, and programs of several keys become one function and
    a call for each: without a model where they differ in defaults only, else by a model, each call being run in a
    simulator against the program whose work it does. Each result is stored separately; if the command is stopped, the
    book is valid and the next call continues.
    """
    if watch and (dry_run or all_):
        raise InvalidArgument("--watch", "beside --dry-run or --all", "one of them")
    if interval is not None and not watch:
        raise InvalidArgument("--interval", "without --watch", "both of them")
    if until_eof and not watch:
        raise InvalidArgument("--until-eof", "without --watch", "both of them")
    if until_eof:
        from memo_core.process.companion_process import end_with_input

        end_with_input()
    registry, experiment = load(config, overrides)
    from memo_core.runs.consolidation import Spending, check_method, clustering_of
    from memo_core.runs.factories import book_of

    check_method(experiment)
    with book_of(experiment, book, read_only=True):
        pass  # a mistyped path is an error, not a new empty book
    from memo_core.cli.execute import stopping as stopping_robots
    from memo_core.maintenance.paired_trials import PairedTrials

    spending = Spending()
    with stopping() as stop, book_of(experiment, book, read_only=dry_run) as opened, ExitStack() as stack:
        tester = StoppableTrials(PairedTrials(opened, registry, stopping_robots), stop)
        clustering = stack.enter_context(clustering_of(experiment, opened, spending.note, stop, keep, tester))
        if keep is not None and not dry_run:
            opened.note_place("run", keep)  # for memo skillbook forget
        if watch:
            _watch(experiment, opened, clustering, stop, interval, spending, json)
        else:
            _Once(opened, clustering, spending, json, dry_run).run(all_)


@attrs.frozen
class StoppableTrials:
    """Paired trials that a signal also stops before the next one begins: while a scene is built, no robot is there to
    be stopped."""

    trials: PairedTrials
    stop: StopSwitch

    def compare(self, template: Entry, program: str) -> Verdict:
        """Compare as ``PairedTrials.compare`` does. Raises ``KeyboardInterrupt`` for a stop."""
        return self.trials.compare(template, program, lambda start: self.stop.check(f"running a program from {start}"))


@attrs.define
class _Once:
    """One pass over the book. What was finished before an error or Ctrl-C is stored and reported."""

    book: Skillbook
    clustering: Clustering
    spending: Spending
    json: bool
    dry_run: bool
    joined: list[NearKeys] = attrs.field(factory=list)
    outcomes: list[ClusterOutcome] = attrs.field(factory=list)
    groups: list[Consolidated | GroupOutcome] = attrs.field(factory=list)
    waiting: int = 0

    def run(self, unchanged: bool) -> None:
        ended: MemoError | KeyboardInterrupt | None = None
        try:
            self._pass(unchanged)
        except (MemoError, KeyboardInterrupt) as error:
            ended = error
        self._report()
        if isinstance(ended, (Stopped, KeyboardInterrupt)):
            left = f"{self.waiting} clusters left; " if self.waiting else ""
            note(f"memo: stopped; {left}the next memo cluster continues")
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
        with progress_bar() as bar:
            bar.add_task("functions of several keys", total=None)
            for made in self.clustering.consolidate_groups(unchanged, commit=not self.dry_run):
                self.groups.append(made)

    def _report(self) -> None:
        from memo_core.runs.consolidation import group_record, outcome_record

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
                    "groups": [group_record(one) for one in self.groups],
                }
            )
            return
        if not self.joined and not done and not self.waiting and not self.groups:
            print("nothing to condense")
            return
        for near in self.joined:
            would = "would be" if self.dry_run else "is"
            print(f"{near.spelling} {would} merged into {near.key} (cosine {near.cosine:.2f})")
        for one in done:
            print_outcome(one)
        verb = "would become" if self.dry_run else "became"
        if done or self.waiting:
            print(
                f"{totals['clusters']} clusters: {totals['entries_before']} entries {verb} {totals['entries_after']}, "
                f"{totals['characters_before']} characters {totals['characters_after']}"
            )
        for group in self.groups:
            print_group(group)
        print(_said_of(self.spending))


def print_group(outcome: Consolidated | GroupOutcome) -> None:
    """Print a consolidation of several keys as a diff: programs and notes that are replaced, the functions with their
    calls, and how the calls did."""
    from rich.text import Text

    from memo_core.policy.generalising import GroupOutcome
    from memo_core.skillbook.model.entries import headline, key_label

    shown = console(width=None if sys.stdout.isatty() else 400, highlight=False)
    group = outcome if isinstance(outcome, GroupOutcome) else None
    made = outcome.made if isinstance(outcome, GroupOutcome) else outcome
    if group is not None and made is None:
        why = group.problem or "nothing belongs together"
        shown.print(Text(f"{group.label}: {len(group.group.members)} programs are unchanged: {why}", style="bold"))
    if made is not None:
        keys = ", ".join(dict.fromkeys(key_label(entry.key) for entry in made.members))
        counts = f"{made.entries_before} -> {made.entries_after} entries"
        shown.print(Text(f"{keys}: {counts}, {made.characters_before} -> {made.characters_after} characters", "bold"))
        texts = {entry.id: f"{key_label(entry.key)} {headline(entry.kind, entry.text)}" for entry in made.members}
        for function in made.change.functions:
            for line in function.code.rstrip().splitlines():
                shown.print(Text(f"  + {line}", style="green"))
            for entry, call in function.calls:
                shown.print(Text(f"  - {entry}: {texts[entry]}", style="red"))
                shown.print(Text(f"  + {call}", style="green") + Text(_tested(group, entry), style="dim"))
        for note, index in made.change.inside:
            name = made.change.functions[index].name
            shown.print(Text(f"  - {note}: {texts[note]}", style="red") + Text(f"   [{name} does that]", style="dim"))
        for wider in made.change.notes:
            for note in wider.of:
                shown.print(Text(f"  - {note}: {texts[note]}", style="red"))
            shown.print(Text(f"  + {wider.text}", style="green") + Text("   [under all these keys]", style="dim"))
        for former in made.functions:
            shown.print(Text(f"  - {former.id}: {headline(former.kind, former.text)}", style="red"))
    for entry, why in (group.left if group is not None else {}).items():
        shown.print(Text(f"  {entry} is left as it is: {why}", style="dim"))
    if group is not None and group.untested:
        shown.print(Text(f"  not tested: {group.untested}", style="yellow"))


def _tested(group: GroupOutcome | None, entry: int) -> str:
    """The successes of the call in place of an entry, for a list."""
    starts = () if group is None else group.tested.get(entry, ())
    return f"   [succeeded from {sum(ok for _, ok, _ in starts)} of {len(starts)} starts]" if starts else ""


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
    from memo_core.policy.generalising import GroupOutcome
    from memo_core.runs.consolidation import group_record, outcome_record, watch
    from memo_core.skillbook.functions import Consolidated
    from memo_core.skillbook.writing.key_aliases import NearKeys

    def report(news: Any) -> None:
        if isinstance(news, (Consolidated, GroupOutcome)):
            print(dumps(group_record(news), ensure_ascii=False), flush=True) if json else print_group(news)
        elif isinstance(news, ClusterOutcome):
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
    except (Stopped, KeyboardInterrupt):
        pass
    finally:
        if json:
            print(dumps({"spent": spending.record()}), flush=True)
        else:
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
