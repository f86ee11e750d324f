"""Latency of the stop button of a page, in a real browser (``memo bench web-stop``).

The pages stream the arm in 3-D and its cameras' pictures, and a second page is open. For each press of the button or of
Escape: milliseconds to the last command that the arm was given, and until the page says that the robot has stopped.
"""

from __future__ import annotations

import random
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from memo_benchmarks.stop import MovingModel, Presser, StopTask, WatchedLink
from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import BackendUnavailable, Stopped
from memo_core.interfaces.teacher import Stage, Teacher
from memo_core.plugins.registry import Registry
from memo_core.policy.loop import Loop
from memo_core.policy.methods import METHODS
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.runs.factories import book_of, library_of, sandbox_of
from memo_core.runs.signal_handling import Supervisor

AIM_MS = 150.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
_WAIT_MS = 180_000
_MOVING_S = 0.25  # since the last command, at most: the arm moves (drawing pictures takes a part of it)
_RANDOM_S = (0.1, 0.6)  # that it has moved when the button is pressed


def bench_web_stop(
    experiment: Experiment, registry: Registry, presses: int, progress: Callable[[float], None] = lambda share: None
) -> dict[str, Any]:
    """Measure with the experiment's simulator and robot; its teacher must be ``web``. Call it in the main thread.

    Raises ``BackendUnavailable`` without Chromium or playwright."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise BackendUnavailable("browser", "chromium", "there is none here", "apt-get install chromium")
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        remedy = "pip install playwright"
        raise BackendUnavailable("browser", "playwright", "it is not installed", remedy) from None
    teacher = experiment.create("teacher")
    teacher.open()
    try:
        return _Measuring(experiment, registry, teacher, browser, presses, progress).measure()
    finally:
        teacher.close()


class _Measuring:
    def __init__(
        self,
        experiment: Experiment,
        registry: Registry,
        teacher: Teacher,
        browser: str,
        presses: int,
        progress: Callable[[float], None],
    ) -> None:
        self._experiment, self._registry, self._teacher = experiment, registry, teacher
        self._browser, self._presses, self._progress = browser, presses, progress
        self._watched = WatchedLink()
        self._supervisor = Supervisor(StopSwitch(), teacher)
        self._commands: list[float] = []
        self._shown: list[float] = []
        self._problem: BaseException | None = None

    def measure(self) -> dict[str, Any]:
        person = threading.Thread(target=self._press_often, name="bench-person", daemon=True)
        person.start()
        self._supervisor.run(self._work)
        person.join(_WAIT_MS / 1000)
        if self._problem is not None:
            raise self._problem
        command, shown = np.array(self._commands), np.array(self._shown)
        return {
            "presses": len(command),
            "command_median_ms": round(float(np.median(command)), 1),
            "command_p99_ms": round(float(np.percentile(command, 99)), 1),
            "command_max_ms": round(float(command.max()), 1),
            "stopped_shown_median_ms": round(float(np.median(shown)), 1),
            "stopped_shown_max_ms": round(float(shown.max()), 1),
            "aim_ms": AIM_MS,
        }

    # -- the run, in the supervisor's worker ---------------------------------------------------------------------------
    def _work(self) -> None:
        experiment, stop = self._experiment, self._supervisor.stop
        world = SimulatedEnvironment(
            StopTask(),
            0,
            simulator=experiment.create("simulator"),
            robot=experiment.create("robot"),
            perception=experiment.create("perception"),
            link=self._watched.link,
        )
        scratch = TemporaryDirectory(ignore_cleanup_errors=True)
        with scratch as place, world, sandbox_of(experiment) as sandbox, stop.waking(world.link.stop):
            world.pace()
            log = RunLog(Path(place))
            log.begin({"run": "bench"}, {})
            book = book_of(experiment, f"sqlite:///{Path(place) / 'book.db'}", read_only=False)
            self._teacher.watch(self._stage(world, Path(place)))
            with book:
                session = Session(
                    run="bench",
                    environment=world,
                    llm=MovingModel(),
                    skills=library_of(experiment),
                    sandbox=sandbox,
                    settings=RunSettings(video="off", time_limit_s=1e9, settle_s=0.0, subtasks=10**6, repeats=10**6),
                    stop=stop,
                    log=log,
                    emit=self._registry.emit,
                    book=book,
                    person=Presser(self._supervisor),
                )
                try:
                    Loop(session, METHODS["memo"]).run()
                except Stopped:
                    pass
                finally:
                    self._teacher.unwatch()
                    log.close()

    def _stage(self, world: SimulatedEnvironment, folder: Path) -> Stage:
        return Stage(
            robot=world.robot,
            link=world.link,
            perception=world.perception,
            folder=folder,
            stop=self._supervisor.stop.press,
            end=self._supervisor.end,
            simulator=world.simulator,
            scene=world.description,
        )

    # -- the person, in a thread of their own --------------------------------------------------------------------------
    def _press_often(self) -> None:
        try:
            self._in_browser()
        except BaseException as error:
            self._problem = error
        finally:
            self._supervisor.end()

    def _in_browser(self) -> None:
        from playwright.sync_api import sync_playwright

        url = str(getattr(self._teacher, "url"))  # noqa: B009 - the teacher's class is a plugin's
        rng = random.Random(0)
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=self._browser, args=list(_FLAGS))
            page, second = browser.new_page(), browser.new_page()
            page.set_default_timeout(_WAIT_MS)
            second.goto(f"{url}teach")
            page.goto(f"{url}teach")
            page.bring_to_front()
            for number in range(self._presses):
                self._await_motion(page, rng.uniform(*_RANDOM_S))
                if number % 2:
                    page.keyboard.press("Escape")
                else:
                    page.locator(".memo-stop").click()
                page.get_by_test_id("stop-state").filter(has_text="stopped").wait_for()
                shown = time.time()
                pressed = page.evaluate("window.memoPressed") / 1000
                self._commands.append(max(0.0, self._watched.last_wall - pressed) * 1e3)
                self._shown.append((shown - pressed) * 1e3)
                self._progress((number + 1) / self._presses)
                page.locator("[data-choice=silent]").click()
                page.locator("[data-choice=silent]").wait_for(state="hidden")
            browser.close()

    def _await_motion(self, page: Any, seconds: float) -> None:
        """Wait until the arm has moved for so long without a pause. A program that ended by itself is begun again."""
        until, began = time.monotonic() + _WAIT_MS / 1000, time.monotonic()
        while time.monotonic() - began < seconds:
            if time.monotonic() - self._watched.last > _MOVING_S:
                if (over := page.locator("[data-choice=silent]")).count():
                    over.click()
                began = time.monotonic()
            if time.monotonic() > until:
                raise TimeoutError("the arm does not move")
            time.sleep(0.002)
