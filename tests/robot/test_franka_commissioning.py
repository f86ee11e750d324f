"""``memo robot commission`` and ``check`` through TCP and UDP, with a person played by the double's faults."""

from __future__ import annotations

import itertools
import json
import os

import numpy as np
import pytest
from memo_franka.description import fr3
from memo_franka.driver import FrankaDriver
from memo_franka.settings import FrankaSettings
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble

from memo_core.arm.simulated_link import IncludedGripper
from memo_core.cli import commission
from memo_core.environment.commissioning import check_commissioning, read_commissioning
from memo_core.environment.hardware import HardwareSettings
from memo_core.environment.hardware_check import examine_robot
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.robot.safety import SafetyLimits

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = [
    pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time"),
    pytest.mark.usefixtures("real_time"),
    pytest.mark.wire,
]

ROBOT, LIMITS = fr3(), SafetyLimits()
BUSY = {"clock_timeout_s": 5.0, "hand_deadline_s": 60.0}  # a busy computer slows the double down
ADDRESSES = (f"127.{1 + os.getpid() % 200}.230.{1 + n % 200}" for n in itertools.count())


@pytest.fixture
def box():
    address = next(ADDRESSES)
    hand = HandDouble(address)
    with hand, ControlBox(ROBOT, address, hand=hand) as box:
        yield box


class Person:
    """Pushes, is taken towards one corner, and puts a cube between the fingers."""

    def __init__(self, box: ControlBox, push: float = 10.0) -> None:
        self.box, self.push = box, push
        self.told: list[str] = []
        self.corners = 0

    def tell(self, text: str) -> None:
        self.told.append(text)
        if "the push was felt" in text:
            self.box.push([0.0, 0.0, 0.0])

    def answer(self, question: str) -> str:
        return "Ada" if "name" in question else "295341-1325"

    def ready(self, what: str) -> bool:
        if "Push" in what:
            self.box.push([self.push, 0.0, 0.0])
        if "cube between" in what:
            self.box.hand.fingers.thing = 0.04
        if "The tool moves" in what:
            self.corners += 1
            return self.corners == 6
        return True


def commissioned(box: ControlBox, file, person: Person, monkeypatch, **changes) -> None:
    monkeypatch.setattr(commission, "_AtTheTerminal", lambda: person)
    config = {"backend": "fr3", "driver": "franka", "address": box.address} | BUSY | changes
    commission.command(None, [f"robot.{key}={value}" for key, value in config.items()], file)


def link_to(box: ControlBox, **changes):
    link = FrankaDriver(FrankaSettings(box.address, **BUSY | changes)).link(ROBOT, IncludedGripper())
    link.open()
    return link


def test_a_commissioned_arm_is_described_in_a_file_that_later_runs_are_checked_against(box, tmp_path, monkeypatch):
    file = tmp_path / "arm.json"
    commissioned(box, file, Person(box), monkeypatch)
    found = read_commissioning(file)
    assert (found.by, found.arm, found.lifted) == ("Ada", "295341-1325", True)
    assert found.push[0] == pytest.approx(10.0, abs=1.0) and found.bias < 1.0
    low, high = np.array(LIMITS.workspace[:3]), np.array(LIMITS.workspace[3:])
    [reached] = np.array(found.corners)
    assert ((low < reached) & (reached < high)).all() and reached[1] > 0.2 and reached[2] > 0.6, "towards its corner"
    assert not box.arm.violations and box.recoveries == 0
    link = link_to(box)
    check_commissioning(file, ROBOT, box.address, link)
    link.close()
    link = link_to(box, force_sign=1.0, load_mass=0.5)
    with pytest.raises(BackendUnavailable, match=r"load was 0.00 kg.*force sign was -1, is 1|force sign.*load"):
        check_commissioning(file, ROBOT, box.address, link)
    link.close()


def test_a_reversed_force_is_found_and_no_file_is_written(box, tmp_path, monkeypatch):
    file = tmp_path / "arm.json"
    with pytest.raises(InvalidArgument, match=r"robot\.force_sign"):
        commissioned(box, file, Person(box), monkeypatch, force_sign=1.0)
    assert not file.exists()


def test_a_push_in_another_direction_is_not_taken_for_one_along_x(box, tmp_path, monkeypatch):
    person = Person(box)
    box.push([0.0, 0.0, 0.0])
    monkeypatch.setattr(box, "push", lambda force, push=box.push: push([0.0, force[0], 0.0]))
    with pytest.raises(InvalidArgument, match="along the base's x"):
        commissioned(box, tmp_path / "arm.json", person, monkeypatch)


def test_the_check_tells_versions_load_and_thresholds_and_that_nothing_was_commissioned(box, tmp_path):
    driver = FrankaDriver(FrankaSettings(box.address, clock_timeout_s=5.0))
    found = {one.what: one for one in examine_robot(driver, IncludedGripper(), ROBOT, HardwareSettings(), None, 0.2)}
    assert "franky-control" in found["client library"].detail and "0.73 kg" in found["end effector"].detail
    assert found["load"].detail == "0.00 kg beyond it" and "35 N" in found["collision thresholds"].detail
    assert found["commissioning"].state == "warning" and "memo robot commission" in found["commissioning"].remedy
    missing = HardwareSettings(commissioning=str(tmp_path / "none.json"))
    found = {one.what: one for one in examine_robot(driver, IncludedGripper(), ROBOT, missing, None, 0.2)}
    assert found["commissioning"].state == "failed" and "cannot be read" in found["commissioning"].detail


def test_a_file_that_is_no_commissioning_is_refused(tmp_path):
    file = tmp_path / "arm.json"
    file.write_text(json.dumps({"robot": "fr3"}), encoding="utf-8")
    with pytest.raises(InvalidArgument, match=r"arm\.json is no such file.*memo robot commission"):
        read_commissioning(file)
