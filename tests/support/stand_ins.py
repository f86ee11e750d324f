"""What takes long and reads nothing of the input, replaced within one process: physics, the sentence model, looking for
plugins, building the tree of commands, starting the sandbox. A share of the inputs is run without any of this
(``bench``)."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import NonCallableMock, patch

from typer.main import get_command

from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Sighting
from memo_core.plugins.entry_points import installed
from memo_core.sandbox.sandbox import Sandbox
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import SceneGraph
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_environment import FakeEnvironment, fake_robot


class NoPerception(Perception):
    """Has no model and no pictures. The kinematic environment does not look through it."""

    def start(self, context: PerceptionContext) -> None: ...

    def look(self) -> SceneGraph:
        raise NotImplementedError("the kinematic environment looks by itself")


class QuickEnvironment(SimulatedEnvironment):
    """A simulated environment of which everything moves kinematically, as in ``FakeEnvironment``. What is not told
    here is that of the real class, so that no part of it can be missing."""

    def __init__(self, task: Task) -> None:
        simulator: Simulator = NonCallableMock(spec=Simulator, control_period=1.0)
        super().__init__(task, 0, simulator, fake_robot(), NoPerception())
        self._fake = FakeEnvironment(task.instruction)
        self.description = SceneDescription(bodies=())
        self.monitors = {}

    def _open(self) -> None:
        self._link, self.control = self._fake.link, self._fake.control

    def _close(self) -> None: ...

    def check(self) -> Outcome:
        return Outcome(False, "nothing is checked here")

    def settle(self, seconds: float = 0.5) -> None:
        self._fake.settle(seconds)

    def checkpoint(self) -> bytes:
        return self._fake.checkpoint()

    def restore(self, checkpoint: bytes) -> None:
        self._fake.restore(checkpoint)

    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        self._fake.start_watching(seen)

    def sightings(self) -> tuple[Sighting, ...]:
        return self._fake.sightings()

    def stop_watching(self) -> tuple[Sighting, ...]:
        return self._fake.stop_watching()

    def glance(self) -> SceneGraph:
        return self._fake.glance()


@contextmanager
def stood_in() -> Iterator[None]:
    """While the block runs. For one process, from its main thread."""
    from memo_core.cli import app, options
    from memo_core.config.experiment import Choice
    from memo_core.plugins.registry import Registry
    from memo_core.runs import factories

    sandboxes: dict[Any, Sandbox] = {}
    make, create, tree = factories.sandbox_of, Choice.create, app._tree

    def sandbox_of(experiment: Any) -> Sandbox:
        limits = experiment.section("sandbox")
        if limits not in sandboxes:
            sandboxes[limits] = make(experiment)
            sandboxes[limits].close = lambda: None  # type: ignore[method-assign]
        return sandboxes[limits]

    def created(choice: Choice) -> Any:
        return FakeEmbedder() if choice.backend.kind == "embedder" else create(choice)

    def environment_of(experiment: Any, task: Task, seed: int) -> QuickEnvironment:
        return QuickEnvironment(task)

    def command(typed: str) -> Any:  # Typer would build it anew for each call: most of the time of a short command
        return get_command(tree(typed))

    fakes = {"world_of": environment_of, "environment_of": environment_of, "sandbox_of": sandbox_of}
    originals = {name: getattr(factories, name) for name in fakes}
    with ExitStack() as patches:
        patches.callback(_rebind, fakes, originals)
        _rebind(originals, fakes)
        patches.enter_context(patch.object(Choice, "create", created))
        patches.enter_context(patch.object(app, "installed", functools.cache(installed)))
        patches.enter_context(patch.object(app, "_tree", functools.cache(command)))
        registry = Registry()
        patches.enter_context(patch.object(options, "load_registry", lambda: registry))
        try:
            yield
        finally:
            for sandbox in sandboxes.values():
                Sandbox.close(sandbox)


def _rebind(old: dict[str, Any], new: dict[str, Any]) -> None:
    """Replace functions wherever a module has bound them: also one that was imported before or while they stood in."""
    for module in [one for name, one in sys.modules.items() if name.startswith("memo_")]:
        for name in old:
            if vars(module).get(name) is old[name]:
                setattr(module, name, new[name])
