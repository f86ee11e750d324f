"""Mechanisms: the state machine on its own, and every mechanism of the quirks suite by physics, pushed by known forces.

The conformance suite for simulators has the rules that every simulator must keep.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import attrs
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_tabletop.quirks.buttons import OpenTheRiceCooker, OpenTheSafe
from memo_tabletop.quirks.dispensers import PepperTheSoup
from memo_tabletop.quirks.doors import OpenTheCupboard, OpenTheLocker, OpenTheWardrobe
from memo_tabletop.quirks.drawers import OpenTheDresser, OpenTheNightstand, OpenTheWorkbench
from memo_tabletop.quirks.turning import OpenTheMedicineBottle, TurnOnTheHeater

from memo_core.errors import InvalidArgument
from memo_core.interfaces.simulator import Contact
from memo_core.scene.description import Body, Geom, SceneDescription, Slide
from memo_core.scene.mechanism_state import Mechanisms
from memo_core.scene.mechanisms import (
    Above,
    AllOf,
    AnyOf,
    Below,
    Lasting,
    Lock,
    Locked,
    Pressed,
    Spring,
    Times,
)
from memo_core.testing.perception import StillWorld

TICK = 0.01
BOX = (Geom("box", (0.1, 0.1, 0.1)),)


def rail(name: str) -> Body:
    joint = Slide(name, (1, 0, 0), range=(-1.0, 1.0), stiffness=3.0, rest=0.1)
    return Body(f"{name} body", BOX, joint=joint)


def scene(*mechanisms) -> SceneDescription:
    return SceneDescription((rail("a"), rail("b")), mechanisms=mechanisms)


class Bench(StillWorld):
    """A world whose joints are moved by hand, and which writes down what the mechanisms ask for."""

    def __init__(self, *mechanisms) -> None:
        super().__init__(scene(*mechanisms))
        self.limits: dict[str, tuple[float, float]] = {}
        self.springs: dict[str, tuple[float, float]] = {}
        self.presses: tuple[Contact, ...] = ()
        self.asked = 0
        self.mechanisms = Mechanisms(self.scene, self, self)

    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        self.limits[joint] = (lower, upper)

    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        self.springs[joint] = (stiffness, rest)

    def contacts(self, body=None):
        self.asked += 1
        return self.presses

    def put(self, ticks: int = 1, **joints: float) -> Bench:
        """Let the joints be here for so many ticks."""
        self.joints.update(joints)
        for _ in range(ticks):
            self.seconds += TICK
            self.mechanisms.update()
        return self

    def press(self, *links: tuple[str, float]) -> None:
        self.presses = tuple(Contact("a body", f"robot/{link}", (0, 0, 0), force) for link, force in links)

    @property
    def locked(self) -> bool:
        return self.mechanisms.engaged["lock"]


def lock(until, **more) -> Bench:
    return Bench(Lock("lock", "b", (0.0, 0.2), until=until, **more))


# -- conditions -------------------------------------------------------------------------------------------------------


def test_a_lock_limits_its_joint_until_its_condition_and_then_no_more():
    bench = lock(Above("a", 0.5))
    assert bench.limits == {"b": (0.0, 0.2)}
    assert bench.put(a=0.5).locked, "above means more than"
    assert not bench.put(a=0.51).locked
    assert bench.limits == {"b": (-1.0, 1.0)}
    assert not bench.put(a=0.0).locked, "without `again` it stays open"


def test_below_is_the_mirror_of_above():
    bench = lock(Below("a", -0.5))
    assert bench.put(a=-0.5).locked
    assert not bench.put(a=-0.51).locked


def test_chatter_within_the_slack_is_one_press():
    bench = lock(Times(Above("a", 0.5, slack=0.1), 2)).put(a=0.0)
    for _ in range(20):
        bench.put(a=0.51).put(a=0.45)
    assert bench.locked
    bench.put(a=0.39)
    assert not bench.put(a=0.51).locked


def test_what_is_true_at_the_outset_has_not_become_true():
    bench = lock(Times(Above("a", 0.5), 1))
    assert bench.put(5, a=0.6).locked
    assert not bench.put(a=0.4).put(a=0.6).locked


def test_a_condition_must_last_without_a_break():
    bench = lock(Lasting(Above("a", 0.5), 1.0))
    assert bench.put(90, a=0.6).put(a=0.4).put(100, a=0.6).locked
    assert not bench.put(a=0.6).locked, "1.0 s after the first tick at which it held"


def test_times_must_come_within_their_time():
    for pause, opens in ((90, True), (110, False)):
        bench = lock(Times(Above("a", 0.5), 3, within=2.0))
        for _ in range(3):
            bench.put(pause, a=0.0).put(a=0.6)
        assert bench.locked != opens
    assert not bench.put(20, a=0.0).put(a=0.6).put(20, a=0.0).put(a=0.6).locked, "the last three count"


def test_a_press_is_that_of_the_hardest_pressing_link_all_its_contacts_together():
    bench = lock(Pressed("a body", 10.0))
    bench.press(("left", 6.0), ("right", 6.0))
    assert bench.put().locked
    bench.press(("left", 6.0), ("left", 5.0))
    assert not bench.put().locked


def test_what_the_scene_presses_is_no_press():
    bench = lock(Pressed("a body", 10.0))
    bench.presses = (Contact("a body", "table", (0, 0, 0), 100.0),)
    assert bench.put().locked


def test_contacts_are_asked_for_once_a_tick_and_only_while_somebody_waits():
    press = Pressed("a body", 10.0)
    bench = Bench(Lock("lock", "b", (0.0, 0.2), until=press), Lock("other", "a", (-1.0, 0.2), until=press))
    bench.put(5)
    assert bench.asked == 5
    bench.press(("left", 20.0))
    bench.put(5)
    assert bench.asked == 6, "both are open for good"


@pytest.mark.parametrize(("kind", "opens"), [(AllOf, False), (AnyOf, True)])
def test_all_of_and_any_of(kind, opens):
    bench = lock(kind((Above("a", 0.5), Below("a", -0.5))))
    assert bench.put(a=0.6).locked != opens


def test_every_condition_of_a_group_is_watched_even_where_another_decides():
    bench = lock(AllOf((Above("b", 0.1), Lasting(Above("a", 0.5), 1.0))))
    bench.put(200, a=0.6, b=0.0)
    assert not bench.put(a=0.6, b=0.15).locked, "the second had lasted long enough"


# -- locks and springs ------------------------------------------------------------------------------------------------


def test_a_lock_engages_again_only_where_it_can_hold_the_joint():
    bench = lock(Above("a", 0.5), again=Below("a", 0.0))
    bench.put(a=0.6).put(a=-0.1, b=0.7)
    assert not bench.locked and bench.limits["b"] == (-1.0, 1.0)
    assert bench.put(b=0.1).locked and bench.limits["b"] == (0.0, 0.2)


def test_counting_begins_anew_when_a_lock_engages_again():
    bench = lock(Times(Above("a", 0.5), 2), again=Below("b", 0.05))
    bench.put(b=0.1)
    for _ in range(2):
        bench.put(a=0.0).put(a=0.6)
    assert not bench.locked
    assert bench.put(a=0.6, b=0.0).locked
    bench.put(b=0.1)
    assert bench.put(a=0.0).put(a=0.6).locked, "one press of two"
    assert not bench.put(a=0.0).put(a=0.6).locked


def test_two_locks_on_one_joint_hold_it_where_both_do():
    bench = Bench(
        Lock("one", "b", (-0.5, 0.2), until=Above("a", 0.5)), Lock("other", "b", (-0.1, 0.6), until=Above("a", 0.7))
    )
    assert bench.limits["b"] == (-0.1, 0.2)
    assert bench.put(a=0.6).limits["b"] == (-0.1, 0.6)
    assert bench.put(a=0.8).limits["b"] == (-1.0, 1.0)


def test_a_spring_acts_while_its_condition_holds_and_the_joints_own_otherwise():
    bench = Bench(Spring("b", 50.0, 0.3, when=Above("a", 0.5)))
    assert bench.springs == {"b": (3.0, 0.1)}
    assert bench.put(a=0.6).springs == {"b": (50.0, 0.3)}
    assert bench.put(a=0.4).springs == {"b": (3.0, 0.1)}


def test_a_spring_may_depend_on_a_lock():
    bench = Bench(Lock("lock", "b", (0.0, 0.2), until=Above("a", 0.5)), Spring("b", 50.0, 0.3, when=Locked("lock")))
    assert bench.put().springs == {"b": (50.0, 0.3)}
    assert bench.put(a=0.6).springs == {"b": (3.0, 0.1)}, "in the very tick in which the lock lets go"


def test_a_scene_without_mechanisms_has_none():
    assert not Bench().mechanisms
    assert lock(Above("a", 0.5)).mechanisms


MIXED = (
    Lock("lock", "b", (-0.3, 0.4), until=Times(Above("a", 0.3, slack=0.2), 2, within=0.2), again=Below("b", -0.2)),
    Lock("stop", "a", (-1.0, 0.5), until=Lasting(Above("b", 0.2), 0.05), again=Lasting(Below("a", 0.0), 0.03)),
    Lock("press", "a", (-0.9, 0.9), until=AnyOf((Pressed("b body", 5.0), AllOf((Locked("lock"), Above("b", 0.3)))))),
    Spring("a", 9.0, 0.2, when=AnyOf((Locked("stop"), Times(Below("b", 0.0), 3)))),
)


@settings(max_examples=60, deadline=None)
@given(
    path=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 9)), min_size=2, max_size=60),
    data=st.data(),
)
def test_continuing_from_memory_is_continuing(path, data):
    """Whatever happens, a machine that takes over another's memory does what that one does."""
    middle = data.draw(st.integers(0, len(path)))

    def move(bench: Bench, steps) -> list:
        seen = []
        for a, b, force in steps:
            bench.press(("left", force))
            bench.put(a=a, b=b)
            seen.append((bench.mechanisms.engaged, dict(bench.limits), dict(bench.springs)))
        return seen

    one = Bench(*MIXED)
    move(one, path[:middle])
    memory = json.loads(json.dumps(one.mechanisms.memory()))
    other = Bench(*MIXED)
    move(other, data.draw(st.lists(st.sampled_from(path), max_size=5)))
    other.seconds = one.seconds
    other.mechanisms.recall(memory)
    assert (other.limits, other.springs) == (one.limits, one.springs)
    assert move(other, path[middle:]) == move(one, path[middle:])
    assert other.mechanisms.memory() == one.mechanisms.memory()


@pytest.mark.parametrize("memory", [{}, {"locks": [], "springs": []}, {"locks": [[1]], "springs": []}, {"locks": 3}])
def test_the_memory_of_other_mechanisms_is_refused(memory):
    with pytest.raises(InvalidArgument, match="mechanisms' memory"):
        lock(Times(Above("a", 0.5), 2)).mechanisms.recall(memory)


@pytest.mark.parametrize(
    ("mechanism", "says"),
    [
        (Lock("x", "c", (0.0, 0.1)), "no joint 'c'.*a, b"),
        (Lock("x", "a", (0.0, 2.0)), "within the joint's range"),
        (Lock("x", "a", (0.2, 0.1)), "within the joint's range"),
        (Lock("x", "a", (0.2, 0.3)), "starts at 0"),
        (Lock("x", "a", (0.0, 0.1), until=Above("c", 1.0)), "lock 'x'.*no joint 'c'"),
        (Lock("x", "a", (0.0, 0.1), until=Above("b", 1.0, slack=-1.0)), "slack of -1"),
        (Lock("x", "a", (0.0, 0.1), until=Pressed("c", 1.0)), "no body 'c'.*a body"),
        (Lock("x", "a", (0.0, 0.1), until=Pressed("a body", 0.0)), "0.0 N"),
        (Lock("x", "a", (0.0, 0.1), again=Lasting(Above("b", 1.0), 0.0)), "0.0 s"),
        (Lock("x", "a", (0.0, 0.1), again=Times(Above("b", 1.0), 0)), "0 times"),
        (Lock("x", "a", (0.0, 0.1), again=Times(Above("b", 1.0), 1, within=0.0)), "gives 0.0 s"),
        (Lock("x", "a", (0.0, 0.1), until=AllOf(())), "no conditions"),
        (Lock("x", "a", (0.0, 0.1), until=AnyOf((Times(Locked("y"), 1),))), "no lock 'y'.*x"),
        (Spring("c", 1.0, 0.0, when=Above("a", 0.0)), "spring on 'c'.*no joint"),
        (Spring("a", -1.0, 0.0, when=Above("a", 0.0)), "stiffness of -1"),
    ],
)
def test_what_cannot_work_is_refused_with_what_would_be_right(mechanism, says):
    with pytest.raises(InvalidArgument) as error:
        Bench(mechanism)
    import re

    assert re.search(says, str(error.value), re.DOTALL), str(error.value)


def test_two_locks_of_one_name_are_refused():
    with pytest.raises(InvalidArgument, match="two locks are called 'x'"):
        Bench(Lock("x", "a", (0.0, 0.1)), Lock("x", "b", (0.0, 0.1)))


# -- the mechanisms of the quirks suite, by physics -------------------------------------------------------------------


@attrs.frozen
class Step:
    """Forces on joints (N or Nm) for so long, then where joints must be."""

    seconds: float
    forces: dict[str, float]
    then: Callable[[Callable[[str], float]], bool]


def step(seconds: float, then: Callable[[Callable[[str], float]], bool], **forces: float) -> Step:
    return Step(seconds, forces, then)


def near(joint: str, value: float, within: float) -> Callable[[Callable[[str], float]], bool]:
    return lambda at: abs(at(joint) - value) < within


def beyond(joint: str, value: float) -> Callable[[Callable[[str], float]], bool]:
    return lambda at: at(joint) > value


def nothing(at: Callable[[str], float]) -> bool:
    return True


# Per task: what is done to its joints (names without the thing's), and what must have become of it.
CASES = {
    "a push latch holds 25 Nm, and springs open when pushed": (
        OpenTheCupboard,
        step(2.0, near("hinge", 0.0, 0.003), hinge=25.0),
        step(0.5, near("hinge", 0.0, 0.003)),
        step(0.3, nothing, hinge=-4.0),
        step(4.0, beyond("hinge", 1.5)),
    ),
    "pushed not far enough, it stays shut": (
        OpenTheCupboard,
        step(0.5, nothing, hinge=-1.0),
        step(2.0, near("hinge", 0.0, 0.003)),
    ),
    "a drawer's push latch holds 60 N, and springs open when pushed": (
        OpenTheNightstand,
        step(2.0, near("slide", 0.0, 0.0015), slide=60.0),
        step(0.3, nothing, slide=-15.0),
        step(3.0, beyond("slide", 0.12)),
    ),
    "a bolt holds 25 Nm, and lets go with the handle lifted": (
        OpenTheLocker,
        step(1.0, near("hinge", 0.012, 0.004), hinge=25.0),
        step(0.5, near("hinge", 0.0, 0.004), hinge=-2.0),
        step(0.5, beyond("lift", 0.02), lift=15.0),
        step(1.0, beyond("hinge", 0.3), lift=15.0, hinge=2.0),
    ),
    "lifted under strain, the bolt jams": (
        OpenTheLocker,
        step(0.5, near("hinge", 0.012, 0.003), hinge=8.0),
        step(0.5, beyond("lift", 0.02), lift=15.0, hinge=8.0),
        step(1.0, near("hinge", 0.012, 0.003), lift=15.0, hinge=8.0),
    ),
    "the bolt falls back when the handle is let go": (
        OpenTheWorkbench,
        step(0.5, beyond("lift", 0.02), lift=15.0),
        step(0.5, near("lift", 0.0, 0.003)),
        step(1.0, near("slide", 0.004, 0.002), slide=40.0),
    ),
    "a drawer sticks half-way, however long and hard it is pulled": (
        OpenTheDresser,
        step(1.0, near("slide", 0.068, 0.004), slide=40.0),
        step(3.0, near("slide", 0.069, 0.003), slide=90.0),
        step(0.5, lambda at: 0.03 < at("slide") < 0.062),
        step(1.0, beyond("slide", 0.12), slide=30.0),
    ),
    "pushed back and pulled again, it comes too": (
        OpenTheDresser,
        step(1.0, near("slide", 0.068, 0.004), slide=40.0),
        step(0.1, lambda at: 0.005 < at("slide") < 0.058, slide=-3.0),
        step(1.5, beyond("slide", 0.12), slide=30.0),
    ),
    "shut again, it sticks again": (
        OpenTheDresser,
        step(1.0, nothing, slide=40.0),
        step(0.5, nothing),
        step(1.0, beyond("slide", 0.12), slide=30.0),
        step(2.0, near("slide", 0.0, 0.002), slide=-20.0),
        step(1.5, near("slide", 0.068, 0.004), slide=40.0),
    ),
    "a door sticks half-way and gives way to the second pull": (
        OpenTheWardrobe,
        step(2.0, lambda at: 0.74 < at("hinge") < 0.83, hinge=15.0),
        step(0.5, lambda at: 0.6 < at("hinge") < 0.72),
        step(2.0, beyond("hinge", 1.0), hinge=6.0),
    ),
    "a lid stays shut until its button was held for two seconds": (
        OpenTheRiceCooker,
        step(1.9, near("hinge", 0.0145, 0.004), press=8.0),
        step(0.3, nothing),
        step(1.9, near("hinge", 0.0145, 0.004), press=8.0),
        step(0.3, nothing),
        step(2.1, nothing, press=8.0),
        step(2.0, beyond("hinge", 1.3)),
    ),
    "the safe's too, and pulling does not help": (
        OpenTheSafe,
        step(2.0, lambda at: at("hinge") < 0.025, hinge=25.0),
        step(2.2, nothing, press=8.0),
        step(4.0, beyond("hinge", 1.5)),
    ),
    "a cap does not turn unless it is pressed, nor come off": (
        OpenTheMedicineBottle,
        step(1.0, lambda at: at("turn") < 0.09, turn=2.0),
        step(1.0, lambda at: at("press") < 0.003, press=40.0),
        step(1.0, beyond("turn", 1.2), turn=0.6, press=-15.0),
        step(1.0, beyond("press", 0.05), press=4.0),
    ),
    "let up half-way, a cap springs back": (
        OpenTheMedicineBottle,
        step(0.3, nothing, press=-15.0),
        step(0.15, lambda at: 0.1 < at("turn") < 1.25, turn=0.35, press=-15.0),
        step(1.5, near("turn", 0.0, 0.06)),
        step(1.0, lambda at: at("turn") < 0.09, turn=1.0),
    ),
    "a knob that was turned far enough stays": (
        TurnOnTheHeater,
        step(1.0, lambda at: at("turn") < 0.09, turn=2.0),
        step(1.0, beyond("turn", 1.3), turn=0.6, press=-20.0),
        step(1.0, beyond("turn", 1.15), turn=-2.0),
    ),
}


def built(make) -> MujocoSimulator:
    simulator = MujocoSimulator()
    simulator.open()
    simulator.build(make().scene(np.random.default_rng(0)), panda())
    return simulator


def push(simulator: MujocoSimulator, thing: str, one: Step) -> None:
    simulator.data.qfrc_applied[:] = 0.0
    for joint, force in one.forces.items():
        simulator.data.qfrc_applied[simulator._world.joint_dof[f"{thing}/{joint}"]] = force
    for _ in range(round(one.seconds / simulator.control_period)):
        simulator.tick()


@pytest.mark.sim
@pytest.mark.parametrize("name", CASES)
def test_a_mechanism_holds_what_it_says_and_lets_go_when_it_says(name):
    make, *steps = CASES[name]
    thing = make().thing
    with built(make) as simulator:

        def at(joint: str) -> float:
            return simulator.joint_position(f"{thing}/{joint}")

        for number, one in enumerate(steps):
            push(simulator, thing, one)
            where = {joint: round(at(joint.split("/")[1]), 4) for joint in simulator._world.joint_qpos}
            assert one.then(at), f"after step {number + 1} of {name!r}: {where}"


@pytest.mark.sim
@pytest.mark.parametrize(
    "name",
    [
        "a drawer sticks half-way, however long and hard it is pulled",
        "a lid stays shut until its button was held for two seconds",
        "let up half-way, a cap springs back",
    ],
)
def test_restored_in_the_middle_a_mechanism_goes_on_bit_by_bit(name):
    make, *steps = CASES[name]
    thing = make().thing
    with built(make) as simulator:
        for number, one in enumerate(steps):
            half = attrs.evolve(one, seconds=one.seconds / 2)
            push(simulator, thing, half)
            middle = simulator.checkpoint()
            push(simulator, thing, half)
            expected = [simulator.joint_position(joint) for joint in simulator._world.joint_qpos]
            locks = simulator.mechanisms.engaged
            simulator.restore(middle)
            push(simulator, thing, half)
            again = [simulator.joint_position(joint) for joint in simulator._world.joint_qpos]
            assert again == expected and simulator.mechanisms.engaged == locks, f"step {number + 1}"


def jerk(simulator: MujocoSimulator, times: int, pause: float) -> bool:
    """Whether the valve is open after the weight lagged, down and up, so many times."""
    for _ in range(times):
        push(simulator, "pepper mill", Step(0.1, {"weight": -0.3}, nothing))
        push(simulator, "pepper mill", Step(0.1, {"weight": 0.3}, nothing))
        push(simulator, "pepper mill", Step(pause, {}, nothing))
    return simulator.joint_position("pepper mill/valve") > 0.02


@pytest.mark.sim
@pytest.mark.parametrize(("times", "pause", "opens"), [(2, 0.5, False), (3, 0.5, True), (3, 2.2, False)])
def test_a_dispenser_gives_after_three_jerks_in_quick_succession(times, pause, opens):
    with built(PepperTheSoup) as simulator:
        assert jerk(simulator, times, pause) is opens


@pytest.mark.sim
def test_a_tick_with_mechanisms_costs_little():
    """Read and decide: well below the 15 microseconds that the motion loop may add to a tick."""
    import time

    with built(OpenTheMedicineBottle) as simulator:
        simulator.tick()
        started = time.thread_time()
        for _ in range(2000):
            simulator.mechanisms.update()
        assert (time.thread_time() - started) / 2000 < 15e-6


@pytest.mark.sim
def test_hinge_limits_of_a_checkpoint_are_those_of_its_locks():
    with built(OpenTheCupboard) as simulator:
        shut = simulator.checkpoint()
        push(simulator, "cupboard", Step(0.3, {"hinge": -4.0}, nothing))
        push(simulator, "cupboard", Step(4.0, {}, nothing))
        assert simulator.joint_position("cupboard/hinge") > math.radians(80)
        opened = simulator.checkpoint()
        simulator.restore(shut)
        push(simulator, "cupboard", Step(1.0, {"hinge": 10.0}, nothing))
        assert abs(simulator.joint_position("cupboard/hinge")) < 0.003
        simulator.restore(opened)
        push(simulator, "cupboard", Step(1.0, {}, nothing))
        assert simulator.joint_position("cupboard/hinge") > math.radians(80)
