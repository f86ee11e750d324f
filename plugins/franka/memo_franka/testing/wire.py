"""The packets of the Franka control interface, server version 10, and of the Hand, version 3.

Layouts are those of libfranka-common's public headers (Apache-2.0): packed, little-endian, matrices column by column.
"""

from __future__ import annotations

import struct
from enum import IntEnum

import numpy as np

VERSION, PORT = 10, 1337
HAND_VERSION, HAND_PORT = 3, 1338


class Command(IntEnum):
    CONNECT = 0
    MOVE = 1
    STOP_MOVE = 2
    SET_COLLISION_BEHAVIOR = 3
    SET_JOINT_IMPEDANCE = 4
    SET_CARTESIAN_IMPEDANCE = 5
    SET_GUIDING_MODE = 6
    SET_EE_TO_K = 7
    SET_NE_TO_EE = 8
    SET_LOAD = 9
    AUTOMATIC_ERROR_RECOVERY = 10
    GET_ROBOT_MODEL = 11


class RobotMode(IntEnum):
    OTHER = 0  # brakes shut, or starting up
    IDLE = 1
    MOVE = 2
    GUIDING = 3
    REFLEX = 4
    USER_STOPPED = 5
    RECOVERY = 6


class Generator(IntEnum):
    """Motion generators, as states name them; ``Move`` requests count from one less."""

    IDLE = 0
    JOINT_POSITION = 1
    JOINT_VELOCITY = 2
    CARTESIAN_POSITION = 3
    CARTESIAN_VELOCITY = 4
    NONE = 5


class Controller(IntEnum):
    JOINT_IMPEDANCE = 0
    CARTESIAN_IMPEDANCE = 1
    EXTERNAL = 2
    OTHER = 3


class MoveStatus(IntEnum):
    SUCCESS = 0
    MOTION_STARTED = 1
    PREEMPTED = 2
    COMMAND_NOT_POSSIBLE = 5
    REFLEX_ABORTED = 8
    EMERGENCY_ABORTED = 9
    INPUT_ERROR_ABORTED = 10
    ABORTED = 11


REJECTED = 1  # of every other command: not possible in this mode


class Error(IntEnum):
    """The errors of a state that the test double can raise, by their index."""

    JOINT_POSITION_LIMITS = 0
    JOINT_VELOCITY = 3
    JOINT_REFLEX = 6
    CARTESIAN_REFLEX = 7
    GENERATOR_POSITION_LIMITS = 12
    GENERATOR_VELOCITY_LIMITS = 13
    GENERATOR_VELOCITY_DISCONTINUITY = 14
    GENERATOR_ACCELERATION_DISCONTINUITY = 15
    COMMUNICATION_CONSTRAINTS = 25
    TORQUE_RANGE = 28
    TORQUE_DISCONTINUITY = 32


HEADER = struct.Struct("<III")  # command, id, size with the header
CONNECT = struct.Struct("<HH")  # version, UDP port
MOVE = struct.Struct("<II24s24s?56s")  # controller, generator, deviations, asynchronous, velocities

_MATRICES = ("O_T_EE", "O_T_EE_d", "F_T_EE", "EE_T_K", "F_T_NE", "NE_T_EE")
_INERTIAS = (("m_ee", 1), ("I_ee", 9), ("F_x_Cee", 3), ("m_load", 1), ("I_load", 9), ("F_x_Cload", 3))
_JOINTS = ("tau_J", "tau_J_d", "dtau_J", "q", "q_d", "dq", "dq_d", "ddq_d", "joint_contact")
_CARTESIAN = (
    *(("O_dP_EE_d", 6), ("O_ddP_O", 3), ("elbow_c", 2), ("delbow_c", 2), ("ddelbow_c", 2)),
    *(("O_T_EE_c", 16), ("O_dP_EE_c", 6), ("O_ddP_EE_c", 6), ("theta", 7), ("dtheta", 7)),
    *(("accelerometer_top", 18), ("accelerometer_bottom", 18)),
)
_FLOATS = (
    *((name, 16) for name in _MATRICES),
    *_INERTIAS,
    *(("elbow", 2), ("elbow_d", 2)),
    *((name, 7) for name in _JOINTS),
    *(("cartesian_contact", 6), ("joint_collision", 7), ("cartesian_collision", 6)),
    *(("tau_ext_hat_filtered", 7), ("O_F_ext_hat_K", 6), ("K_F_ext_hat_K", 6)),
    *_CARTESIAN,
)
STATE = np.dtype(
    [
        ("message_id", "<u8"),
        *((name, "<f4", (count,)) for name, count in _FLOATS),
        ("motion_generator_mode", "u1"),
        ("controller_mode", "u1"),
        ("errors", "u1", (41,)),
        ("reflex_reason", "u1", (41,)),
        ("robot_mode", "u1"),
        ("control_command_success_rate", "<f4"),
    ]
)
COMMAND = np.dtype(
    [
        ("message_id", "<u8"),
        ("q_c", "<f8", (7,)),
        ("dq_c", "<f8", (7,)),
        ("O_T_EE_c", "<f8", (16,)),
        ("O_dP_EE_c", "<f8", (6,)),
        ("elbow_c", "<f8", (2,)),
        ("valid_elbow", "u1"),
        ("motion_generation_finished", "u1"),
        ("tau_J_d", "<f8", (7,)),
        ("torque_command_finished", "u1"),
    ]
)
assert (STATE.itemsize, COMMAND.itemsize) == (1377, 371), "not the packets of server version 10"


class HandCommand(IntEnum):
    CONNECT = 0
    HOMING = 1
    GRASP = 2
    MOVE = 3
    STOP = 4


class HandStatus(IntEnum):
    SUCCESS = 0
    FAIL = 1
    UNSUCCESSFUL = 2
    ABORTED = 3


HAND_HEADER = struct.Struct("<HII")  # command, id, size with the header
HAND_MOVE = struct.Struct("<dd")  # width, speed
HAND_GRASP = struct.Struct("<ddddd")  # width, inner and outer epsilon, speed, force
HAND_STATE = struct.Struct("<Idd?H")  # id, width, greatest width, grasped, temperature
