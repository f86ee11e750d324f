"""The world of a run: every observation and every motion, one method each, recorded in the run's log.

Between effects the loop only computes, so that it can be run again with the effects answered from the log
(``memo_core.runlog``). A new effect is a kind (one line) and a method that calls ``RunLog.effect``. The person and the
skillbook are wrapped in the same way (``logged_person``, ``logged_book``).
"""

from __future__ import annotations

import base64
import json
import time
import zlib
from collections.abc import Sequence
from typing import Any

import attrs

from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.teacher import Sighting
from memo_core.policy.pictures import Picture, PictureFiles, taken
from memo_core.policy.run_context import Session
from memo_core.process.stop_switch import Leaving
from memo_core.runlog.run_log import Effect, LogMismatch
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.graph import SceneGraph
from memo_core.scene.graph_json import pack_scenes, scene_of, scene_record, unpack_scenes
from memo_core.text.parsing import read_as


@attrs.frozen(eq=False)
class Executed:
    """How code ended, and how long it took on the robot's clock and in wall-clock time (s)."""

    execution: Execution
    took_s: float
    wall_s: float = 0.0

    @property
    def moved(self) -> bool:
        return self.took_s > 0

    @property
    def stopped(self) -> bool:
        return self.execution.ended == "stopped"


class LoggedWorld:
    """The environment of one run, as its loop uses it.

    Attributes:
        scene: what the robot saw last.
        pictures: pictures of the last look, if prompts are to have them.
        leaving: the work that a stop leaves behind in another thread.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._environment = session.environment
        self._log = session.log
        self.leaving = Leaving(session.stop)
        self._time = 0.0  # s, on the robot's clock, after the last effect
        self._world = b""  # the newest checkpoint
        self._looks: list[dict[str, Any]] = []  # since it was taken
        self._seen: list[Sighting] | None = None  # since somebody began to watch
        self._files = PictureFiles(session.log.folder)
        self.pictures: tuple[Picture, ...] = ()
        self.scene: SceneGraph = session.environment.control.scene()
        if self.exact:
            self._log.world_known = True  # it is put back
        self._log.before_live(self._catch_up)

    @property
    def exact(self) -> bool:
        """Whether the world can be restored exactly."""
        return self._environment.link.can_restore

    @property
    def time(self) -> float:
        """Seconds on the robot's clock."""
        return self._time

    def catch_up(self) -> None:
        """Bring the world to the state in which the run left it, even if every effect was answered from the log."""
        self._log.go_live()

    def close(self) -> None:
        """Wait for abandoned work, since nothing may use the world while it is being closed."""
        self.leaving.wait()

    # -- seeing --------------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """The world as the run finds it."""
        kind: Effect[SceneGraph] = Effect("start", self._keep_scene, self._read_scene)
        self.scene = self._log.effect(kind, self._environment.instruction, lambda _: self._environment.control.scene())

    def look(self) -> SceneGraph:
        """Take a new look with the robot's perception. Skills use its result from now on."""
        kind: Effect[SceneGraph] = Effect("look", self._keep_look, self._read_look, world=True)
        self.scene = self._log.effect(kind, "", lambda _: self._look())
        return self.scene

    def _look(self) -> SceneGraph:
        scene = self._environment.look()
        if self._session.images:
            self.pictures = taken(self._environment.pictures(scene))
            if not self.pictures:
                given = "this perception has no pictures"
                raise InvalidArgument(
                    "policy.images", given, "perception.backend=cameras, or perception.images=[CAMERA]"
                )
        return scene

    def glance(self) -> SceneGraph:
        """What a person in the room sees now, or saw last while the robot is still stopping."""
        kind: Effect[SceneGraph] = Effect("glance", scene_record, scene_of)
        return self._log.effect(
            kind, "", lambda _: self._last_seen() if self.leaving.busy else self._environment.glance()
        )

    def _last_seen(self) -> SceneGraph:
        seen = self._environment.sightings()
        return seen[-1].scene if seen else self.scene

    def start_watching(self) -> None:
        kind: Effect[None] = Effect("start watching", lambda _: self._keep_seen(), self._read_start)
        self._seen = []
        self._log.effect(kind, "", lambda _: self._environment.start_watching())

    def stop_watching(self) -> tuple[Sighting, ...]:
        """What a person saw since ``start_watching``."""
        kind: Effect[tuple[Sighting, ...]] = Effect("stop watching", self._keep_seen, self._read_seen)
        seen = self._log.effect(kind, "", lambda _: self._stop_watching())
        self._seen = None
        return seen

    def _stop_watching(self) -> tuple[Sighting, ...]:
        """Nothing is observed while another thread still moves the robot, because a simulator allows one user at a
        time."""
        return self._environment.sightings() if self.leaving.busy else self._environment.stop_watching()

    # -- acting --------------------------------------------------------------------------------------------------------
    def execute(self, code: str, wall_seconds: float) -> Executed:
        """Run code in the sandbox, for at most ``wall_seconds`` of wall-clock time. A stop is a normal result here:
        ``Executed.stopped``."""
        outside = not self.exact  # a simulated motion is repeated after a power failure
        kind: Effect[Executed] = Effect("execute", self._keep_executed, self._read_executed, outside, world=True)
        return self._log.effect(kind, str(len(code)), lambda _: self._execute(code, wall_seconds))

    def settle(self, seconds: float) -> None:
        """Let objects come to rest. Raises ``Stopped``."""
        kind: Effect[None] = Effect("settle", self._keep_moved, self._read_moved, world=True)
        self._log.effect(kind, f"{seconds:g} s", lambda _: self._environment.settle(seconds))

    def checkpoint(self) -> bytes:
        """The state of the whole world; empty if it cannot be restored exactly."""
        kind: Effect[bytes] = Effect("checkpoint", self.keep_world, self.read_world)
        return self._log.effect(kind, "", lambda _: self._environment.checkpoint()) if self.exact else b""

    def restore(self, checkpoint: bytes) -> None:
        """Restore the state of the world exactly."""
        kind: Effect[None] = Effect("restore", lambda _: {"time": self._now()}, self._read_time, outside=True)
        self._log.effect(kind, "", lambda _: self._environment.restore(checkpoint))
        self._world, self._looks = checkpoint, []

    def release(self) -> None:
        """Let the robot move again after a stop was answered."""

        def release(_: int) -> None:
            self.leaving.wait()
            self._environment.stop_watching()  # where that had to wait for the robot to come to rest
            self._session.release()

        self._log.effect(Effect[None]("release", outside=True), "", release)

    def _execute(self, code: str, wall_seconds: float) -> Executed:
        started, began = self._environment.time(), time.monotonic()
        session = self._session
        workspace = Workspace.around(self._environment.robot.reach, self.scene.table_height)
        try:
            execution = self.leaving.do(
                "moving",
                lambda: session.sandbox.run(
                    code,
                    self._environment.control,
                    stopped=lambda: session.stop.pressed or self._environment.link.stopped,
                    workspace=workspace,
                    on_start=session.emit,
                    on_call=session.emit,
                    clock=self._environment.time,
                    wall_seconds=wall_seconds,
                ),
            )
        except Stopped:
            execution = Execution("stopped", error="stopped", kind="stop")
        return Executed(execution, self._environment.time() - started, time.monotonic() - began)

    # -- the world of a resumed run ------------------------------------------------------------------------------------
    def _catch_up(self) -> None:
        """Restore the newest checkpoint, repeat the looks since and go on watching. Raises ``LogMismatch`` if a look
        shows something else than it did."""
        if self.exact:
            if self._world:
                self._environment.restore(self._world)
            for logged in self._looks:
                if json.dumps(scene_record(self._environment.look())) != json.dumps(logged):
                    raise LogMismatch(str(self._log.folder), 0, "a look at its scene", "a look that shows another")
        if self._seen is not None:
            self._environment.start_watching(tuple(self._seen))

    # -- how results are kept ------------------------------------------------------------------------------------------
    def _keep_scene(self, scene: SceneGraph) -> dict[str, Any]:
        return {"scene": scene_record(scene), "time": self._now()}

    def _read_scene(self, record: dict[str, Any]) -> SceneGraph:
        self._time = record["time"]
        return scene_of(record["scene"])

    def _keep_look(self, scene: SceneGraph) -> dict[str, Any]:
        record = self._kept_look(scene_record(scene))
        return record | {"pictures": self._files.keep(self.pictures)} if self.pictures else record

    def _read_look(self, record: dict[str, Any]) -> SceneGraph:
        self.pictures = self._files.read(record.get("pictures", ()))
        return scene_of(self._kept_look({name: value for name, value in record.items() if name != "pictures"}))

    def _kept_look(self, look: dict[str, Any]) -> dict[str, Any]:
        self._looks.append(look)
        return look

    def _keep_moved(self, _: object = None) -> dict[str, Any]:
        """Record the world as an effect left it, unless another thread is still using it after a stop."""
        record = {"time": self._now(), "seen": self._keep_seen()}
        return record | ({} if self.leaving.busy else self.keep_world())

    def _read_moved(self, record: dict[str, Any]) -> None:
        self._read_time(record)
        self._read_seen(record["seen"])
        if "world" in record:
            self.read_world(record)

    def keep_world(self, checkpoint: bytes | None = None) -> dict[str, Any]:
        if not self.exact:
            return {}
        self._world, self._looks = self._environment.checkpoint() if checkpoint is None else checkpoint, []
        return {"world": base64.b85encode(zlib.compress(self._world, 1)).decode()}

    def read_world(self, record: dict[str, Any]) -> bytes:
        self._world, self._looks = zlib.decompress(base64.b85decode(record["world"])), []
        return self._world

    def _keep_executed(self, executed: Executed) -> dict[str, Any]:
        execution = attrs.asdict(executed.execution, filter=attrs.filters.exclude("calls", "findings"))
        return {"execution": execution, "took_s": executed.took_s, "wall_s": executed.wall_s, **self._keep_moved()}

    def _read_executed(self, record: dict[str, Any]) -> Executed:
        self._read_moved(record)
        return Executed(read_as(Execution, record["execution"]), record["took_s"], record.get("wall_s", 0.0))

    def _now(self) -> float:
        self._time = float(self._environment.time())
        return self._time

    def _read_time(self, record: dict[str, Any]) -> None:
        self._time = record["time"]

    def _keep_seen(self, seen: Sequence[Sighting] | None = None) -> dict[str, Any] | None:
        """The sightings since they were last stored."""
        if self._seen is None:
            return None
        new = (self._environment.sightings() if seen is None else seen)[len(self._seen) :]
        self._seen += new
        return {"times": [one.time for one in new], "scenes": pack_scenes(one.scene for one in new)} if new else None

    def _read_seen(self, record: dict[str, Any] | None) -> tuple[Sighting, ...]:
        if record is not None and self._seen is not None:
            scenes = unpack_scenes(record["scenes"])
            self._seen += [Sighting(*one) for one in zip(record["times"], scenes, strict=True)]
        return tuple(self._seen or ())

    def _read_start(self, record: dict[str, Any] | None) -> None:
        self._read_seen(record)
