"""A test double of the control box: the Franka control interface on loopback, for unmodified client libraries.

It checks what a control box checks (modes, limits, lost packets, collisions) and ends motions as one does. Its clock is
*elastic*: a tick takes at least 1 ms, and during a motion it waits for the command that answers its last state, so that
a busy computer slows the robot's clock instead of losing packets; it can also wait for a client in the same process
(``reader``). Its methods inject faults.

    with ControlBox(fr3(), "127.0.0.2") as box:
        …                        # franky.Robot("127.0.0.2") connects
        box.push([0, 0, 40])     # somebody pushes the hand
"""

from __future__ import annotations

import contextlib
import select
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from memo_core.plugin import Array, RobotDescription, ToolDynamics
from memo_franka.testing.arm import DT, Arm, Body, IdealBody
from memo_franka.testing.hand import HandDouble
from memo_franka.testing.model import arm_urdf
from memo_franka.testing.server import FrankaServer
from memo_franka.testing.wire import (
    COMMAND,
    CONNECT,
    HEADER,
    MOVE,
    PORT,
    REJECTED,
    STATE,
    VERSION,
    Command,
    Controller,
    Error,
    Generator,
    MoveStatus,
    RobotMode,
)

LOST_PACKETS = 20  # in a row, at which a motion ends
_READER_ROUNDS = 1000  # of this thread, without anything read, after which a reader counts as idle in a motion
_STILL_ROUNDS = 3  # the same while nothing moves: the client library then throws away the states that have arrived,
# and waits for one more, for which it would wait while the box waits for it
_INJECT_S = 120.0  # wall-clock time in which a fault takes effect on a busy computer
_ANSWER_S = 0.0003  # wall-clock time in which most answers come: a thread that slept would wait for a busy computer
_REPEAT_S = 0.05  # wall-clock time after which a waiting box sends its last state again
_IDENTITY = np.eye(4).ravel()


@attrs.frozen
class Moment:
    """A tick, and the fastest joint's speed then (rad/s)."""

    tick: int
    speed: float


class ControlBox(FrankaServer):
    """Test double of one arm's control box. ``robot`` describes the arm; ``body`` is what it moves, by default an ideal
    arm.

    ``version`` is its answer to a client's version; any other than 10 refuses today's libraries, as a Panda's box does.
    """

    header = HEADER
    keeps_first_client = True

    def __init__(
        self,
        robot: RobotDescription,
        address: str = "127.0.0.2",
        body: Body | None = None,
        version: int = VERSION,
        patience_s: float = 2.0,
        hand: HandDouble | None = None,
        paced: bool = True,
    ) -> None:
        """``hand`` is moved by this box's clock. ``patience_s``: wall-clock time after which an unanswered state counts
        as 20 lost packets. ``paced``: whether a tick takes at least 1 ms where a ``reader`` is followed too."""
        super().__init__(address, PORT)
        self.robot = robot
        self.version = version
        self.body: Body = body or IdealBody(robot)
        self.arm = Arm(robot, self.body)
        self.hand = hand
        if hand is not None:
            hand.driven = True
        self.mode = RobotMode.IDLE
        self.recoveries = 0
        self.ticks = 0
        self.rested_at = 0  # tick at which the arm came to rest last
        self.disturbed = Moment(0, 0.0)  # when a fault was injected last, or the client was gone
        self.reader: Callable[[], float] | None = None
        """Tells which time of this box's clock (s) the client has read. While it reads along, the clock waits for it: a
        client whose thread the computer starves then finds no jump of the clock."""
        self._read, self._waited = 0.0, 0
        self._patience_s = patience_s
        self._paced = paced
        self._dynamics = ToolDynamics(self.arm.kinematics)
        self._urdf = arm_urdf(robot)
        self._state = np.zeros(1, STATE)[0]
        self._packet, self._sent = b"", 0.0  # the last one sent, and when, wall-clock time
        self._errors = np.zeros(41, bool)
        self._reflex = np.zeros(41, bool)
        self._force_limit, self._torque_limit = np.full(6, 30.0), np.full(7, 20.0)
        self._ne_to_ee, self._ee_to_k = _IDENTITY.copy(), _IDENTITY.copy()
        self._generator, self._controller = Generator.IDLE, Controller.OTHER
        self._move_id: int | None = None
        self._answered = False  # whether a command of this motion has come
        self._lost = 0
        self._to_lose = 0
        self._frozen = False
        self._ticking = threading.Lock()
        self._inbox: deque[Callable[[], None]] = deque()

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """No tick happens within the block, so that the simulator behind the body may be read."""
        with self._ticking:
            yield

    # -- faults: each takes effect before the next tick ----------------------------------------------------------------
    def push(self, force: Sequence[float]) -> None:
        """Push the hand of an ideal arm with ``force`` (N), base axes, until called again."""
        assert isinstance(self.body, IdealBody)
        pushed = self.body
        self._inject(lambda: setattr(pushed, "push", np.array(force, dtype=float)))

    def user_stop(self, pressed: bool) -> None:
        """Press or release the external activation device."""
        self._inject(lambda: self._enter(RobotMode.USER_STOPPED if pressed else RobotMode.IDLE))

    def brakes(self, shut: bool) -> None:
        self._inject(lambda: self._enter(RobotMode.OTHER if shut else RobotMode.IDLE))

    def guide(self, guided: bool) -> None:
        """Press or release the guiding buttons."""
        self._inject(lambda: self._enter(RobotMode.GUIDING if guided else RobotMode.IDLE))

    def lose(self, packets: int) -> None:
        """Lose the next command packets."""
        self._inject(lambda: setattr(self, "_to_lose", packets))

    def freeze(self, frozen: bool) -> None:
        """Send no states and move nothing while the connection stays open."""
        self._inject(lambda: setattr(self, "_frozen", frozen))

    def place(self, q_d: Array) -> None:
        """Let the resting arm stand at desired positions (n,), to which a simulator's ``restore`` has taken it."""
        self._inject(lambda: self.arm.place(q_d))

    def _inject(self, happen: Callable[[], None]) -> None:
        def noted() -> None:
            self.disturbed = self._moment
            happen()

        if (serving := self._thread) is None:
            noted()
            return
        self._inbox.append(noted)
        end = time.monotonic() + _INJECT_S
        while self._running and noted in self._inbox:
            if not serving.is_alive() or time.monotonic() > end:
                raise RuntimeError(f"the double at {self.address} serves no more: a fault does not take effect")
            time.sleep(DT)

    @property
    def _moment(self) -> Moment:
        return Moment(self.ticks, float(np.abs(self.arm.dq_d).max()))

    def _enter(self, mode: RobotMode) -> None:
        """Enter a mode that a person causes; a motion ends and the arm brakes."""
        self._abort(MoveStatus.EMERGENCY_ABORTED if mode == RobotMode.USER_STOPPED else MoveStatus.ABORTED)
        self.mode = mode

    # -- running -------------------------------------------------------------------------------------------------------
    def _cycle(self) -> None:
        while self._inbox:
            self._inbox[0]()
            self._inbox.popleft()
        begins = self._move_id is not None and not self._answered
        waits = self._frozen or (not begins and self._awaits_reader())
        if not waits:
            with self._ticking:
                self._tick()
        if waits and not self._frozen and time.monotonic() - self._sent > _REPEAT_S:
            self.repeat()
        if waits or begins or self._paced or self.reader is None or self._waited:
            now = time.monotonic()
            self._last = max(self._last + DT, now)  # a tick that did not sleep is not made up for
            time.sleep(self._last - now)

    def _awaits_reader(self) -> bool:
        if self.reader is None:
            return False
        read = self.reader()
        ahead = self.ticks * DT > read + 1.5 * DT
        self._waited = self._waited + 1 if ahead and read == self._read else 0
        self._read = read
        return ahead and self._waited < (_STILL_ROUNDS if self._move_id is None else _READER_ROUNDS)

    def _tick(self) -> None:
        moved = not self.arm.resting
        if self._move_id is not None:
            self._move()
        elif moved:
            self.arm.brake()
        else:
            self.arm.hold()
        if moved and self.arm.resting:
            self.rested_at = self.ticks
        self.ticks += 1
        if self.hand is not None:
            self.hand.advance(DT)
        self._check_collision()
        self._send_state()
        if self._move_id is None:
            self._drain()

    def _move(self) -> None:
        """One tick of a motion: wait for the command that answers the last state."""
        command = self._command()
        if self._move_id is None:
            self.arm.brake()  # the client has ended the motion, or is gone
            return
        if command is None and not self._answered:
            self.arm.hold()
            return
        if command is None:
            self._lost += 1
            if self._lost >= LOST_PACKETS:
                self._reflex_with(Error.COMMUNICATION_CONSTRAINTS)
                self.arm.brake()
            elif self._controller == Controller.EXTERNAL:
                self._reject(self.arm.drive(self.arm.torques))
            else:
                self._reject(self.arm.follow(self.arm.dq_d.copy()))
            return
        self._lost = 0
        torques = self._controller == Controller.EXTERNAL
        if torques:
            self._reject(self.arm.drive(command["tau_J_d"]))
        elif self._generator == Generator.JOINT_VELOCITY:
            self._reject(self.arm.follow(command["dq_c"]))
        else:
            self._reject(self.arm.jump(command["q_c"]))
        finished = command["torque_command_finished" if torques else "motion_generation_finished"]
        if self._move_id is not None and finished:
            self._respond(Command.MOVE, self._move_id, bytes([MoveStatus.SUCCESS]))
            self._end_motion()
            self.mode = RobotMode.IDLE

    def _reject(self, wrong: Error | None) -> None:
        if wrong is not None:
            self._reflex_with(wrong)
            self.arm.brake()

    def _command(self) -> np.void | None:
        """The command that answers the last state; None if it is lost, or if none of this motion has arrived yet."""
        until = time.monotonic() + self._patience_s
        while self._running and self._client is not None:
            wait = until - time.monotonic() if self._answered else 0.0
            if self._answered and wait <= 0:
                self._lost = LOST_PACKETS
                return None
            soon = time.monotonic() - self._sent < _ANSWER_S
            ready, _, _ = select.select([self._udp, self._client], [], [], 0.0 if soon else min(max(wait, 0.0), 0.02))
            if not ready and self._answered and not soon:
                self.repeat()
            if self._client in ready:
                self._serve()
                if self._move_id is None:
                    return None
            if self._udp in ready:
                data = self._udp.recv(4096)
                if len(data) != COMMAND.itemsize:
                    continue
                command = np.frombuffer(data, COMMAND)[0]
                if self._answered and command["message_id"] < self.ticks:
                    continue
                if self._to_lose:
                    self._to_lose -= 1
                    return None
                self._answered = True
                return command
            if not self._answered:
                return None
        return None

    def _drain(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                self._udp.recv(4096)

    # -- ends of motions -----------------------------------------------------------------------------------------------
    def _end_motion(self) -> None:
        self._move_id = None
        self._answered = False
        self._lost = 0
        self._generator, self._controller = Generator.IDLE, Controller.OTHER

    def _abort(self, status: MoveStatus) -> None:
        """The motion ends and the arm brakes."""
        move = self._move_id
        self._end_motion()
        if move is not None:
            self._respond(Command.MOVE, move, bytes([status]))

    def _reflex_with(self, error: Error) -> None:
        self._errors[:] = False
        self._errors[error] = True
        self._reflex = self._errors.copy()
        self.mode = RobotMode.REFLEX
        self._abort(MoveStatus.REFLEX_ABORTED)

    def _check_collision(self) -> None:
        if self.mode not in (RobotMode.IDLE, RobotMode.MOVE):
            return
        force = self.body.force
        if (np.abs(force) > self._force_limit).any():
            self._reflex_with(Error.CARTESIAN_REFLEX)
        elif force.any() and (np.abs(self._external_torque()) > self._torque_limit).any():
            self._reflex_with(Error.JOINT_REFLEX)

    def _external_torque(self) -> np.ndarray:
        return self._dynamics.jacobian(self.body.q).T @ self.body.force

    # -- states --------------------------------------------------------------------------------------------------------
    def _send_state(self) -> None:
        if self._client is None or not self._peer[1]:
            return
        state, arm, body = self._state, self.arm, self.body
        state["message_id"] = self.ticks
        state["q"], state["dq"], state["theta"], state["dtheta"] = body.q, body.dq, body.q, body.dq
        state["q_d"], state["dq_d"], state["ddq_d"], state["tau_J_d"] = arm.q_d, arm.dq_d, arm.ddq_d, arm.torques
        rotation, position = self._dynamics.placement(body.q)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        for name in ("O_T_EE", "O_T_EE_d", "O_T_EE_c"):
            state[name] = pose.T.ravel()
        state["F_T_NE"] = state["F_T_EE"] = self._flange_to_tool
        state["NE_T_EE"], state["EE_T_K"] = self._ne_to_ee, self._ee_to_k
        # The sign is that of the force which the robot exerts, as users report of the real one.
        state["O_F_ext_hat_K"] = -body.force
        state["K_F_ext_hat_K"] = np.concatenate([rotation.T @ -body.force[:3], rotation.T @ -body.force[3:]])
        state["tau_ext_hat_filtered"] = self._external_torque() if body.force.any() else 0.0
        state["m_ee"] = 0.73
        state["motion_generator_mode"], state["controller_mode"] = self._generator, self._controller
        state["errors"], state["reflex_reason"] = self._errors, self._reflex
        state["robot_mode"] = self.mode
        state["control_command_success_rate"] = 1.0 - self._lost / 100 if self._move_id is not None else 0.0
        self._packet = state.tobytes()
        self.repeat()

    def repeat(self) -> None:
        """Send the last state again: client libraries give up after a second without a packet, and take one that they
        know for no news. From any thread."""
        self._sent = time.monotonic()
        if self._packet:
            self._send_packet(self._packet)

    @property
    def _flange_to_tool(self) -> np.ndarray:
        pose = np.eye(4)
        half = np.sqrt(0.5)
        pose[:2, :2] = [[half, half], [-half, half]]
        pose[2, 3] = 0.1034
        return pose.T.ravel()

    # -- commands over TCP ---------------------------------------------------------------------------------------------
    def _disconnected(self) -> None:
        super()._disconnected()
        self.disturbed = self._moment
        if self._move_id is not None:
            self._end_motion()
            self.mode = RobotMode.IDLE

    def _answer(self, command: int, number: int, payload: bytes) -> None:
        if command == Command.CONNECT:
            _, port = CONNECT.unpack(payload)
            same = self.version == VERSION
            self._peer = (self._peer[0], port if same else 0)
            self._respond(command, number, bytes([not same]) + self.version.to_bytes(2, "little"))
        elif command == Command.GET_ROBOT_MODEL:
            self._respond(command, number, b"\0" + self._urdf.encode())
        elif command == Command.MOVE:
            self._begin_move(number, payload)
        elif command == Command.STOP_MOVE:
            self._abort(MoveStatus.PREEMPTED)
            if self.mode == RobotMode.MOVE:
                self.mode = RobotMode.IDLE
            self._respond(command, number, b"\0")
        elif command == Command.AUTOMATIC_ERROR_RECOVERY:
            self._recover(number)
        else:
            self._respond(command, number, bytes([self._set(Command(command), payload)]))

    def _begin_move(self, number: int, payload: bytes) -> None:
        controller, generator, *_ = MOVE.unpack(payload)
        wanted = Generator(generator + 1)
        known = wanted in (Generator.JOINT_POSITION, Generator.JOINT_VELOCITY)
        if controller == Controller.EXTERNAL:
            known = self.body.takes_torques and wanted in (Generator.JOINT_VELOCITY, Generator.NONE)
        while self.mode == RobotMode.IDLE and not self.arm.resting:
            self.arm.brake()  # what little is left of the motion before
        if self.mode != RobotMode.IDLE:
            self._respond(Command.MOVE, number, bytes([MoveStatus.COMMAND_NOT_POSSIBLE]))
            return
        if not known or controller > Controller.EXTERNAL:
            self._respond(Command.MOVE, number, bytes([MoveStatus.INPUT_ERROR_ABORTED]))
            return
        self._respond(Command.MOVE, number, bytes([MoveStatus.MOTION_STARTED]))
        self._move_id, self._answered, self._lost = number, False, 0
        self._generator, self._controller, self.mode = wanted, Controller(controller), RobotMode.MOVE
        self._drain()

    def _recover(self, number: int) -> None:
        if self.mode not in (RobotMode.REFLEX, RobotMode.IDLE):
            self._respond(Command.AUTOMATIC_ERROR_RECOVERY, number, bytes([REJECTED]))
            return
        while not self.arm.resting:
            self.arm.brake()
        self.recoveries += 1
        self._errors[:] = False
        self.mode = RobotMode.IDLE
        self._respond(Command.AUTOMATIC_ERROR_RECOVERY, number, b"\0")

    def _set(self, command: Command, payload: bytes) -> int:
        """Carry out a setter and return its status."""
        if self.mode == RobotMode.MOVE:
            return REJECTED
        values = np.frombuffer(payload, "<f8", len(payload) // 8)
        if command == Command.SET_COLLISION_BEHAVIOR:
            self._torque_limit, self._force_limit = values[21:28].copy(), values[46:52].copy()
        elif command == Command.SET_EE_TO_K:
            self._ee_to_k = values.copy()
        elif command == Command.SET_NE_TO_EE:
            self._ne_to_ee = values.copy()
        elif command == Command.SET_LOAD:
            self._state["m_load"] = values[0]
            self._state["F_x_Cload"], self._state["I_load"] = values[1:4], values[4:13]
        return 0
