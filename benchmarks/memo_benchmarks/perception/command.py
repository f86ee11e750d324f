"""``memo bench perception``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_benchmarks.reporting import with_progress
from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table
from memo_core.errors import InvalidArgument, UnknownName

if TYPE_CHECKING:
    from memo_benchmarks.perception.running import Looked, Solved
    from memo_core.config import Experiment
    from memo_core.interfaces.task import Task

EYES = ("perception.backend=cameras", "perception.detector=oracle")
TRUTH = ("perception.backend=ground-truth", "perception.visible_extents=true")
MOMENTS = ("start", "ajar", "end")
SUITES = ("tabletop", "quirks")
CHAIN_WIDTH = 960  # px: a marker of 50 mm at 1.3 m is 33 wide


def perception(
    noise: Annotated[
        list[str] | None, typer.Option("--noise", help="Depth noise, side by side; repeatable. None: none and d435.")
    ] = None,
    calibration: Annotated[
        float, typer.Option("--calibration", min=0, help="With noise: by how much camera poses are wrong (m).")
    ] = 0.001,
    cameras: Annotated[int, typer.Option("--cameras", min=1, max=3, help="How many of the three.")] = 3,
    wrist: Annotated[bool, typer.Option("--wrist", help="With --solutions: and a camera in the hand.")] = False,
    suites: Annotated[list[str] | None, typer.Option("--suite", help="Repeatable. None: tabletop and quirks.")] = None,
    tasks: Annotated[list[str] | None, typer.Option("--task", help="Only these; repeatable.")] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Scenes of each task.")] = 1,
    when: Annotated[
        list[str] | None, typer.Option("--when", help="start, ajar (doors open by chance), end; repeatable.")
    ] = None,
    solutions: Annotated[
        bool, typer.Option("--solutions", help="Instead of looks: the reference solutions with these eyes.")
    ] = False,
    chain: Annotated[
        bool,
        typer.Option(
            "--chain",
            help="Instead: a double of a model that points, masks, markers, two makes of cameras.",
        ),
    ] = False,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="What was measured is kept there and not repeated.")
    ] = Path("runs/bench-perception"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """How far a perception backend is off the truth, by kind of thing, noise off and on side by side; or what the
    tasks' reference solutions achieve with it. Without --set perception.…: cameras with the simulator's masks."""
    from memo_benchmarks.perception.comparing import summary
    from memo_benchmarks.perception.running import looks as measure_looks, solutions as try_solutions

    moments = list(dict.fromkeys(when or ("start", "ajar")))
    for moment in moments:
        if moment not in MOMENTS:
            raise UnknownName("moment", moment, MOMENTS)
    own = list(overrides or ())
    if chain:
        _chain(suites or list(SUITES), tasks, range(seeds), moments, calibration, config, own, out, json)
        return
    eyes = [] if any(one.startswith("perception.backend=") for one in own) else list(EYES)
    looked: list[Looked] = []
    solved: list[Solved] = []
    chosen = [(suite, _tasks(suite, config, own, tasks)) for suite in dict.fromkeys(suites or SUITES)]
    if not any(found for _, found in chosen):
        raise InvalidArgument("--task", f"no suite has {', '.join(tasks or ())}", "see memo tasks list")
    for suite, found in chosen:
        if not found:
            continue
        here = [f"suite.backend={suite}"]
        variants = {
            one: load(config, [*here, *eyes, *own, *_noisy(one, calibration)])[1]
            for one in dict.fromkeys(noise or ("none", "d435"))
        }
        others = [one for one in own if not one.startswith("perception.")]
        truth = load(config, [*here, *TRUTH, *others])[1]
        folder = out / _name(suite, eyes + own, calibration, cameras, wrist)

        def measuring(progress: Any) -> dict[str, Any]:
            if solutions:
                solved.extend(try_solutions(variants, found, range(seeds), cameras, wrist, folder, progress))  # noqa: B023
            else:
                looked.extend(
                    measure_looks(truth, variants, found, range(seeds), moments, cameras, folder, progress)  # noqa: B023
                )
            return {}

        with_progress(f"perception ({suite})", measuring)
    report: dict[str, Any] = {"bench": "perception", "cameras": cameras + wrist, "seeds": seeds}
    names = dict.fromkeys([row.variant for row in looked] + [row.variant for row in solved])
    if solutions:
        report["solutions"] = {name: _solved([row for row in solved if row.variant == name]) for name in names}
    else:
        report["looks"] = {
            name: summary([row.comparison for row in looked if row.variant == name])
            | {"cpu_s": _cpu([row.cpu_s for row in looked if row.variant == name])}
            for name in names
        }
    if json:
        print_json(report)
    elif solutions:
        _print_solutions(report["solutions"])
    else:
        _print_looks(report["looks"])


def _chain(
    suites: list[str],
    tasks: list[str] | None,
    seeds: range,
    moments: list[str],
    calibration: float,
    config: Path | None,
    overrides: list[str],
    out: Path,
    json: bool,
) -> None:
    from memo_benchmarks.perception.chained import chain_looks
    from memo_benchmarks.perception.comparing import summary

    looked: list[Looked] = []
    for suite in dict.fromkeys(suites):
        here = [f"suite.backend={suite}", *overrides]
        truth = load(config, [*here, *TRUTH])[1]
        given = lambda *more, here=here: load(config, [*here, *more])[1]
        found = _tasks(suite, config, overrides, tasks)
        folder = out / _name(f"{suite}-chain", overrides, calibration, 3, False)

        def measuring(progress: Any) -> dict[str, Any]:
            looked.extend(
                chain_looks(given, truth, found, seeds, moments, calibration, CHAIN_WIDTH, folder, progress)  # noqa: B023
            )
            return {}

        with_progress(f"perception, chained ({suite})", measuring)
    report: dict[str, Any] = {"bench": "perception --chain", "cameras": 3, "seeds": len(seeds)}
    report |= {"calibration_mm": 1000 * calibration, "width": CHAIN_WIDTH}
    names = dict.fromkeys(row.variant for row in looked)
    report["looks"] = {
        name: summary([row.comparison for row in looked if row.variant == name])
        | {"looks": sum(row.variant == name for row in looked)}
        | {"cpu_s": _cpu([row.cpu_s for row in looked if row.variant == name])}
        for name in names
    }
    if json:
        print_json(report)
    else:
        _print_looks(report["looks"])


def _tasks(suite: str, config: Path | None, overrides: list[str], wanted: list[str] | None) -> list[Task]:
    from memo_core.runs.factories import tasks_of

    experiment: Experiment = load(config, [f"suite.backend={suite}", *_without_perception(overrides)])[1]
    return [task for task in tasks_of(experiment) if not wanted or task.name in wanted]


def _without_perception(overrides: list[str]) -> list[str]:
    return [one for one in overrides if not one.startswith("perception.")]


def _noisy(noise: str, calibration: float) -> list[str]:
    if noise == "none":
        return []
    return [f"perception.simulated.noise={noise}", f"perception.simulated.calibration_error={calibration}"]


def _name(suite: str, overrides: list[str], calibration: float, cameras: int, wrist: bool) -> str:
    """Results under different settings lie in different folders."""
    from hashlib import sha256

    rest = sha256(repr((sorted(overrides), calibration)).encode()).hexdigest()[:8]
    return f"{suite}-{cameras}{'w' if wrist else ''}-{rest}"


def _cpu(times: list[float]) -> dict[str, float]:
    import numpy as np

    middle, most = np.percentile(times, [50, 95])
    return {"p50": round(float(middle), 3), "p95": round(float(most), 3)}


def _solved(rows: list[Solved]) -> dict[str, Any]:
    by_task: dict[str, list[Solved]] = {}
    for row in rows:
        by_task.setdefault(row.task, []).append(row)
    return {
        "solved": sum(row.success for row in rows),
        "of": len(rows),
        "looks_a_task": round(sum(row.looks for row in rows) / len(rows), 1),
        "cpu_s_a_case": _cpu(timed) if (timed := [row.cpu_s for row in rows if row.cpu_s is not None]) else None,
        "tasks": {
            task: {"solved": sum(row.success for row in own), "of": len(own)} for task, own in sorted(by_task.items())
        },
        "failures": [f"{row.task}, seed {row.seed}: {row.why}" for row in rows if not row.success],
    }


def _print_looks(found: dict[str, Any]) -> None:
    for name, one in found.items():
        rows = [
            (
                group,
                values["n"],
                *(values["mm"][share] for share in ("p50", "p95", "max")),
                *((values["degrees"] or {}).get(share, "") for share in ("p50", "p95", "max")),
            )
            for group, values in one["groups"].items()
        ]
        print_table((name, "n", "mm p50", "p95", "max", "degrees p50", "p95", "max"), rows)
        print(f"open or closed right: {one['states_right']} of {one['states']}")
        print(f"a look: {one['cpu_s']['p50']} s of CPU, p95 {one['cpu_s']['p95']}")
        for what in ("missed", "invented", "unnamed", "misnamed"):
            print(f"{what}: {', '.join(f'{label} ({n})' for label, n in one[what].items()) or 'nothing'}")


def _print_solutions(found: dict[str, Any]) -> None:
    tasks = dict.fromkeys(task for one in found.values() for task in one["tasks"])
    rows: list[tuple[Any, ...]] = [
        (task, *(f"{one['tasks'][task]['solved']} of {one['tasks'][task]['of']}" for one in found.values()))
        for task in tasks
    ]
    rows.append(("all", *(f"{one['solved']} of {one['of']}" for one in found.values())))
    print_table(("reference solution", *(f"noise {name}" for name in found)), rows)
    for name, one in found.items():
        for failure in one["failures"]:
            print(f"noise {name}: {failure}")
