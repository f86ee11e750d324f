"""Trials of ``memo tasks verify``: one task on one seed each, in this process or several, kept in a file if wanted."""

from __future__ import annotations

import hashlib
import multiprocessing
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import attrs

from memo_core.cli.output import note, progress_bar
from memo_core.errors import InvalidArgument, MemoError
from memo_core.runlog.json_lines import append_line, make_writable, read_lines

SHARE_REQUIRED = 0.95  # of the seeds, for reference solutions


@attrs.frozen
class VerifiedTrial:
    """One task on one seed; travels to another process."""

    config: Path | None
    overrides: tuple[str, ...]
    task: str
    seed: int
    plain: bool = False  # whether the plain attempt is tried too
    digested: bool = False  # whether the result carries a digest of what it depends on


def run_trial(trial: VerifiedTrial) -> dict[str, Any]:
    """Verify one task on one seed (also the entry of a worker process). The result of a trial that robot, simulator or
    the task's own code could not carry out is an ``error`` (``RunError``) without outcomes. All that needs the scene is
    done here, since a scene may be expensive to make."""
    from memo_core.config import load_experiment
    from memo_core.environment.task_code import scene_of
    from memo_core.environment.task_environment import generator
    from memo_core.environment.task_verification import verify_task
    from memo_core.plugins.registry import Registry
    from memo_core.runs.factories import environment_of, sandbox_of, task_of
    from memo_core.runs.run_errors import run_error
    from memo_core.runs.sections import SECTIONS
    from memo_core.scene.placement import sunk
    from memo_core.teachers.goal_check import met_at_start, unmet_goal, unseen_goal

    started = time.monotonic()
    # Not ``load``: what it says of plugins and settings has been said once, before the first trial.
    experiment = load_experiment(Registry(), trial.config, trial.overrides, SECTIONS)
    task = task_of(experiment, trial.task)
    try:
        [found] = verify_task(
            lambda seed: environment_of(experiment, task, seed),
            lambda: sandbox_of(experiment),
            [trial.seed],
            trial.plain,
        )
    except MemoError as problem:
        if (error := run_error(problem)) is None:
            raise
        return {"task": trial.task, "seed": trial.seed, "error": attrs.asdict(error)}
    scene = scene_of(task, generator(trial.seed, "scene"))
    result = {
        "task": trial.task,
        "seed": trial.seed,
        "reference": found.reference.success,
        "reference_why": found.error or found.reference.reason,
        "measures": found.reference.measures,
        "null": found.null.success,
        "null_why": found.null.reason,
        "unsettled": dict(found.unsettled),
        "wall_s": time.monotonic() - started,
        "sim_s": found.sim_s,
        "cpu_s": found.cpu_s,
        "touching": dict(found.touching),
        "sunk": sunk(scene),
        "goal_unseen": unseen_goal(task.goal, scene),
        "goal_at_start": bool(found.watched and met_at_start(task.goal, found.watched.before)),
        "goal_unmet": unmet_goal(found.watched) if found.watched and found.reference.success else [],
    }
    if trial.digested:
        result["digest"] = digest_of(experiment)(trial.task, trial.seed)
    if trial.plain:
        result["plain"] = None if found.plain is None else found.plain.success
        result["plain_why"] = "" if found.plain is None else found.plain.reason
    return result


class TrialLog:
    """Results in a file, one JSON line per trial, written as each ends, so that an interrupted sweep can be resumed.

    A line counts only for the same settings, scene and code, of which it carries a digest."""

    def __init__(self, file: Path | None, digest: Callable[[str, int], str]) -> None:
        self._file, self._digest = file, digest
        self._done: dict[tuple[str, int, str], dict[str, Any]] = {}
        if file is None:
            return
        try:
            if file.exists():
                self._read(file)
            make_writable(file)  # what cannot be kept is said before anything is run
        except OSError as error:
            raise _unusable(file, error) from None

    def _read(self, file: Path) -> None:
        for number, result in read_lines(file):
            try:
                key = result["task"], result["seed"], result["digest"]
            except (KeyError, TypeError):
                expected = "a file that verify wrote, or a new one"
                raise InvalidArgument("--out", f"line {number} of {file} is no result", expected) from None
            self._done[key] = result

    def known(self, trial: VerifiedTrial) -> dict[str, Any] | None:
        if (trial.task, trial.seed) not in self._tried:
            return None
        found = self._done.get((trial.task, trial.seed, self._digest(trial.task, trial.seed)))
        return None if found is None or (trial.plain and "plain" not in found) else found

    @property
    def _tried(self) -> set[tuple[str, int]]:
        """Task and seed of each line."""
        return {(task, seed) for task, seed, _ in self._done}

    def outdated(self, trials: Iterable[VerifiedTrial]) -> int:
        """How many of the trials the file has, but not as scene, settings and code are now."""
        tried = self._tried
        old = [(one.task, one.seed) for one in trials if (one.task, one.seed) in tried]
        return sum((*one, self._digest(*one)) not in self._done for one in old)

    def add(self, result: dict[str, Any]) -> None:
        if self._file is None:
            return
        try:
            own = {} if "digest" in result else {"digest": self._digest(result["task"], result["seed"])}
            append_line(self._file, result | own)
        except OSError as error:
            raise _unusable(self._file, error) from None


def _unusable(file: Path, error: OSError) -> InvalidArgument:
    return InvalidArgument("--out", f"{file} cannot be used ({error.strerror})", "a file to write to, or one by verify")


def digest_of(experiment: Any) -> Callable[[str, int], str]:
    """What a result depends on: the experiment's values, the scene, the robot code that is run, and the files of MEMO
    and of the plugins that decide (suite, simulator, robot, drivers, perception, skills)."""
    from memo_core.environment.task_code import scene_of
    from memo_core.environment.task_environment import generator
    from memo_core.runs.code_digest import WITHOUT_MODEL, code_digest
    from memo_core.runs.factories import task_of

    files = code_digest(experiment, WITHOUT_MODEL)
    values = {key: value for key, value in experiment.public().items() if key not in ("task", "seed")}

    def digest(name: str, seed: int) -> str:
        task = task_of(experiment, name)
        code = [text for text in (task.reference_solution, task.plain_attempt) if text]
        parts = (files, sorted(values.items(), key=repr), scene_of(task, generator(seed, "scene")), *code)
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    return digest


def run_trials(trials: Sequence[VerifiedTrial], jobs: int, log: TrialLog) -> list[dict[str, Any]]:
    """All results, with progress on stderr; those in the log are not run again. Raises ``Halted`` after errors by
    which the trials that are left could not be carried out either (``reason_to_stop``)."""
    from memo_core.runs.run_errors import Halted, RunError, reason_to_stop

    results, waiting = [], []
    errors: list[RunError | None] = []
    for trial in trials:
        known = log.known(trial)
        if known is None:
            waiting.append(trial)
        else:
            results.append(known)
    if results:
        note(f"{len(results)} of {len(trials)} trials are in the file already")
    if outdated := log.outdated(waiting):
        note(f"{outdated} of {len(trials)} trials are in the file with other code, settings or scenes: they run again")
    left = Counter(trial.task for trial in waiting)
    with progress_bar() as progress:
        bar = progress.add_task("verifying", total=len(trials), completed=len(results))
        for result in _run(
            waiting, jobs, lambda trial: progress.update(bar, description=f"{trial.task}, seed {trial.seed}")
        ):
            failed = result.get("error")
            errors.append(RunError(**failed) if failed else None)
            if (reason := reason_to_stop(errors)) is not None:
                raise Halted("trials", reason)
            if not failed:
                log.add(result)
            results.append(result)
            progress.advance(bar)
            left[result["task"]] -= 1
            if progress.disable and not left[result["task"]]:  # nothing else is seen of the progress in a file
                note(f"memo: {result['task']} is tried, {len(results)} of {len(trials)} trials")
    return results


def _run(trials: list[VerifiedTrial], jobs: int, began: Callable[[VerifiedTrial], None]) -> Iterable[dict[str, Any]]:
    if jobs == 1:
        for trial in trials:
            began(trial)
            yield run_trial(trial)
        return
    # A fresh interpreter each: rendering contexts and solver threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts_to_the_parent) as pool:
        waiting = {pool.submit(run_trial, trial): trial for trial in trials}
        try:
            for done in as_completed(waiting):
                began(waiting[done])
                yield done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def report_of(name: str, results: list[dict[str, Any]]) -> dict[str, Any]:
    """One task's results together. ``real_time_factor``: seconds simulated in a second of one core's time, with all
    that the reference solutions need: physics, planning, monitors. A trial that could not be carried out is in no count
    but ``not_carried_out``."""
    results = sorted(results, key=lambda result: result["seed"])
    failures = [
        {"seed": r["seed"], "what": "could not be carried out", "why": r["error"]["problem"]}
        for r in results
        if "error" in r
    ]
    results = [r for r in results if "error" not in r]
    not_carried_out = len(failures)
    failures += [
        {"seed": r["seed"], "what": "reference solution failed", "why": r["reference_why"]}
        for r in results
        if not r["reference"]
    ]
    failures += [
        {"seed": r["seed"], "what": "doing nothing succeeded", "why": r["null_why"]} for r in results if r["null"]
    ]
    tried = [r for r in results if r.get("plain") is not None]
    failures += [
        {"seed": r["seed"], "what": "the plain attempt succeeded", "why": r["plain_why"]} for r in tried if r["plain"]
    ]
    simulated, busy = sum(r["sim_s"] for r in results), sum(r["cpu_s"] for r in results)
    return {
        "name": name,
        "seeds": len(results),
        "not_carried_out": not_carried_out,
        "reference": sum(r["reference"] for r in results),
        "null": sum(r["null"] for r in results),
        "plain": sum(r["plain"] for r in tried) if tried else None,
        "plain_seeds": len(tried),
        "wall_s": round(sum(r["wall_s"] for r in results), 2),
        "sim_s": round(simulated, 2),
        "cpu_s": round(busy, 2),
        "real_time_factor": round(simulated / busy, 1) if busy > 0 else None,
        "failures": failures,
        "goal_unseen": next((r["goal_unseen"] for r in results if r.get("goal_unseen")), []),
        "goal_at_start": sum(r.get("goal_at_start", False) for r in results),
        "goal_unmet": _seeds_of(results, "goal_unmet"),
        "sunk": next((r["sunk"] for r in results if r.get("sunk")), []),
        "unsettled": _farthest(results),
    }


def _seeds_of(results: list[dict[str, Any]], key: str) -> dict[str, list[int]]:
    """The lines under a key of the results, with the seeds of each."""
    found: dict[str, list[int]] = {}
    for result in results:
        for line in result.get(key, ()):
            found.setdefault(line, []).append(result["seed"])
    return found


def _farthest(results: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Bodies that moved before the robot did: the most (m), the seed of it, and what they touched then."""
    found: dict[str, dict[str, Any]] = {}
    for result in results:
        for body, metres in result.get("unsettled", {}).items():
            if body not in found or metres > found[body]["m"]:
                found[body] = {"m": metres, "seed": result["seed"]}
                found[body] |= {"touches": result.get("touching", {}).get(body, [])}
    return found


def holds(report: dict[str, Any]) -> bool:
    """Whether a task is verified: every trial carried out, its reference solution succeeds on 19 of 20 seeds, doing
    nothing and the plain attempt on none, and the simulated teacher can judge each sentence of its goal."""
    if report["not_carried_out"] or report["goal_unseen"]:
        return False
    return report["reference"] >= SHARE_REQUIRED * report["seeds"] and not report["null"] and not report["plain"]
