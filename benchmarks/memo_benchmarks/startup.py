"""``memo bench startup``: how long ``memo --help`` takes, against Python importing what it must (typer and rich).

The two are run in turn, so that whatever else the machine does hits both; medians are compared.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import attrs

BASELINE = ("-c", "import typer, rich")
HELP = ("-c", "from memo_core.cli.main import main; main(['--help'])")
LIST = ("-c", "from memo_core.cli.main import main; main(['plugins', 'list', '--json'])")


@attrs.frozen
class StartupBench:
    """Medians in seconds over ``runs``; ``ratio`` is what the promise is about (at most 2)."""

    runs: int
    baseline_s: float  # python -c "import typer, rich"
    help_s: float  # memo --help
    plugins_list_s: float  # memo plugins list
    python_s: float  # python -c ""
    ratio: float


def bench_startup(runs: int = 15, progress: Callable[[float], None] | None = None) -> StartupBench:
    """Measure with new processes; the first round only warms the caches of files and byte code."""
    commands = {"baseline": BASELINE, "help": HELP, "list": LIST, "python": ("-c", "")}
    times: dict[str, list[float]] = {name: [] for name in commands}
    for number in range(runs + 1):
        for name, command in commands.items():
            seconds = _run(command)
            if number:
                times[name].append(seconds)
        if progress is not None:
            progress((number + 1) / (runs + 1))
    median = {name: statistics.median(taken) for name, taken in times.items()}
    return StartupBench(
        runs=runs,
        baseline_s=round(median["baseline"], 4),
        help_s=round(median["help"], 4),
        plugins_list_s=round(median["list"], 4),
        python_s=round(median["python"], 4),
        ratio=round(median["help"] / median["baseline"], 3),
    )


def _run(command: tuple[str, ...]) -> float:
    started = time.perf_counter()
    subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    return time.perf_counter() - started
