"""What a simulator takes of memory, measured where nothing else is: in a process of its own."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import attrs

from memo_benchmarks.sim import bench_scene
from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS

_STATM = Path("/proc/self/statm")


@attrs.frozen
class SimMemory:
    """MB of resident memory added by opening the engine (its import included) and by building ``bench_scene`` with the
    robot; None where the system does not tell."""

    engine_mb: float | None
    scene_mb: float | None


def sim_memory(config: Path | None, overrides: tuple[str, ...]) -> SimMemory:
    """Of the simulator that an experiment file and overrides choose."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_here, config, overrides).result()


def _here(config: Path | None, overrides: tuple[str, ...]) -> SimMemory:
    experiment = load_experiment(Registry(), config, overrides, SECTIONS)
    simulator, robot, scene = experiment.create("simulator"), experiment.create("robot"), bench_scene()
    before = _resident_mb()
    with simulator:
        opened = _resident_mb()
        simulator.build(scene, robot)
        simulator.tick()
        built = _resident_mb()
    if before is None or opened is None or built is None:
        return SimMemory(None, None)
    return SimMemory(round(opened - before, 1), round(built - opened, 1))


def _resident_mb() -> float | None:
    import resource

    if not _STATM.exists():
        return None
    return int(_STATM.read_text().split()[1]) * resource.getpagesize() / 1e6
