"""A policy server that fails while the arm moves: one clear error, the arm at rest, a trial that is an error."""

from __future__ import annotations

import contextlib
import pickle
import threading
import traceback

import msgpack
import numpy as np
import pytest
from memo_vla.double.server import PolicyServer
from memo_vla.method import Vla
from memo_vla.settings import VlaSettings
from memo_vla.wire import pack, unpack
from websockets.sync.server import serve

import memo_core
from memo_core.errors import BackendLost, BackendUnavailable, Stopped
from memo_core.policy.person import Person
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.run_errors import run_error
from memo_core.sandbox import Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_llm import ScriptedModel

pytestmark = [pytest.mark.sim, pytest.mark.wire]


@pytest.fixture(scope="module")
def world():
    experiment = memo_core.load(None, "scene.wrist_camera=true", task="pick-the-left-can")
    with memo_core.make_environment(experiment, seed=0) as made:
        made.start = made.checkpoint()
        yield made


@pytest.fixture
def session(world):
    world.link.release()
    world.restore(world.start)
    library, stop = skill_library(BUILTIN_SKILLS), StopSwitch()
    with stop.waking(world.link.stop):
        yield Session(
            run="test",
            environment=world,
            llm=ScriptedModel({}),
            skills=library,
            sandbox=Sandbox(library),
            settings=RunSettings(video="off"),
            stop=stop,
            emit=lambda event: None,
            person=Person(),
        )
    world.link.release()


class Swinging:
    """A policy that swings the first joint fast, so that the arm moves whenever something happens."""

    def begin(self):
        return self

    def infer(self, observation):
        return {"actions": np.array([[0.3, *observation["observation/state"][1:7], 0.08]] * 5)}


def moving(observation):
    return pack(Swinging().infer(observation))


@contextlib.contextmanager
def faulty(fault):
    """A server that answers once as it should, then as ``fault(connection)`` does; yields its address."""
    over = threading.Event()

    def connection(socket):
        with contextlib.suppress(Exception):
            socket.send(pack({}))
            socket.send(moving(unpack(socket.recv())))
            socket.recv()
            fault(socket, over)
            over.wait(20)

    server = serve(connection, "127.0.0.1", 0, compression=None, max_size=None, close_timeout=0.1)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
    finally:
        over.set()
        server.shutdown()


def sends(frame):
    return lambda socket, over: socket.send(frame)


def reports(socket, over):
    try:
        raise RuntimeError("CUDA out of memory")
    except RuntimeError:
        socket.send(traceback.format_exc())
    socket.close(1011)


FAULTS = {
    "stalls": (lambda socket, over: over.wait(20), "did not send an answer within 0.4 s"),
    "closes": (lambda socket, over: socket.close(), "closed the connection"),
    "drops the line": (lambda socket, over: socket.socket.close(), "closed the connection"),
    "sends NaN": (sends(pack({"actions": np.full((5, 8), np.nan)})), "not finite"),
    "sends infinity": (sends(pack({"actions": np.full((5, 8), np.inf)})), "not finite"),
    "sends the actions of another arm": (sends(pack({"actions": np.zeros((5, 7))})), "shape (5, 7)"),
    "sends too few actions": (sends(pack({"actions": np.zeros((2, 8))})), "shape (2, 8)"),
    "sends one action flat": (sends(pack({"actions": np.zeros(8)})), "shape (8,)"),
    "sends a list": (sends(pack({"actions": [[0.0] * 8] * 5})), "no array 'actions'"),
    "sends no actions": (sends(pack({"server_timing": {}})), "no array 'actions'"),
    "sends a pickle": (sends(pickle.dumps({"actions": np.zeros((5, 8))})), "pickle"),
    "hides a pickle in an array": (
        sends(msgpack.packb({"actions": {b"__ndarray__": True, b"data": b"x", b"dtype": "|O", b"shape": [5, 8]}})),
        "array of object",
    ),
    "sends half a message": (sends(moving({"observation/state": np.zeros(8)})[:-9]), "no message"),
    "sends a traceback": (reports, "RuntimeError: CUDA out of memory"),
}


def settings_for(url, **more):
    return VlaSettings(url=url, preset="joints", timeout_s=0.4, **more)


def assert_at_rest(world):
    before = world.link.joint_positions()
    world.settle(0.5)
    assert np.abs(world.link.joint_velocities()).max() < 0.01
    assert np.abs(world.link.joint_positions() - before).max() < 0.05  # what it still went while it settled


@pytest.mark.parametrize("name", FAULTS)
def test_a_server_that(name, session, world):
    fault, said = FAULTS[name]
    start = world.link.joint_positions()
    with faulty(fault) as url, pytest.raises(BackendLost) as raised:
        Vla(settings_for(url)).run(session)
    assert said in str(raised.value) and url in str(raised.value) and "\n" not in str(raised.value)
    assert np.abs(world.link.joint_positions() - start).max() > 0.05  # it had moved, and
    assert_at_rest(world)
    error = run_error(raised.value)
    assert error is not None and not error.persistent  # a trial that is an error, not a failure of the policy


def test_no_server_is_an_error_that_every_trial_would_have(session, world):
    with pytest.raises(BackendUnavailable, match="memo policy-server") as raised:
        Vla(settings_for("ws://127.0.0.1:9")).run(session)
    assert run_error(raised.value).persistent


def test_a_web_server_that_is_no_policy_server_is_told_apart(session):
    def text(connection, request):
        return connection.respond(404, "no such page\n")

    server = serve(lambda socket: None, "127.0.0.1", 0, process_request=text)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with pytest.raises(BackendUnavailable, match="404"):
        Vla(settings_for(f"ws://127.0.0.1:{server.socket.getsockname()[1]}")).run(session)
    server.shutdown()


def test_a_stop_ends_the_motion_at_the_next_control_tick(session, world):
    ticks, heard = [], []

    def listen():
        ticks.append(world.link.joint_targets())
        if len(ticks) == 30:
            session.stop.press()
            heard.append(len(ticks))

    world.simulator.add_tick_listener(listen)
    send, sent = world.link.send, []

    def counted(targets):
        send(targets)  # raises once the stop is latched
        sent.append(len(ticks))

    world.link.send = counted
    try:
        with PolicyServer(Swinging()) as server, pytest.raises(Stopped):
            Vla(settings_for(server.url)).run(session)
    finally:
        world.simulator.remove_tick_listener(listen)
        del world.link.send
    assert heard == [30] and len(sent) == 30  # no command after the tick in which it was pressed, but braking
    steps = np.abs(np.diff(ticks[30:], axis=0)).max(axis=1)
    assert len(ticks) < 30 + 60 and steps[-1] < 2e-3  # rad a tick: the braking ends at rest
    world.link.release()
    assert_at_rest(world)


def test_a_stop_does_not_wait_for_a_server_that_computes(session, world):
    asked = threading.Event()

    def stall(socket, over):
        asked.set()
        over.wait(20)

    def press():
        asked.wait(20)
        session.stop.press()

    threading.Thread(target=press, daemon=True).start()
    with faulty(stall) as url, pytest.raises(Stopped):
        Vla(VlaSettings(url=url, preset="joints", timeout_s=3600.0)).run(session)
    world.link.release()
    assert_at_rest(world)


def test_a_motion_through_the_table_is_the_policys_failure(session):
    class Digging(Swinging):
        def infer(self, observation):
            goal = np.array(observation["observation/state"][:7], float)
            goal[1] += 0.15
            return {"actions": np.array([[*goal, 0.08]] * 5)}

    with PolicyServer(Digging()) as server:
        result = Vla(settings_for(server.url)).run(session)
    assert not result.finished and "touches" in result.reason and result.error is None


def test_a_policy_that_keeps_still_has_ended(session, world):
    class Still(Swinging):
        def infer(self, observation):
            return {"actions": np.array([[*world.robot.home, 0.08]] * 5)}

    with PolicyServer(Still()) as server:
        result = Vla(settings_for(server.url, still_s=1.0)).run(session)
    assert result.finished and "kept the arm still for 1 s" in result.reason
    assert result.robot_s == pytest.approx(1.0, abs=0.3)


def test_a_camera_that_is_not_there_is_named_before_anything_moves(session, world):
    start = world.link.joint_targets()
    with PolicyServer(Swinging()) as server, pytest.raises(memo_core.MemoError, match=r"unknown camera 'elbow'.*front"):
        Vla(settings_for(server.url, images={"observation/image": "elbow"})).run(session)
    assert np.array_equal(world.link.joint_targets(), start)
