"""Hand-eye calibration: where a camera is, from pictures of a board at known poses of the arm.

A camera fixed in the world sees a board in the hand, or a camera on the hand sees a board that lies still. With the
tool's pose T_i in the base frame, X the camera's pose (in the base frame, or in the tool's) and Y the board's (in the
tool's frame, or in the base frame), a point p of the board is at X^-1 A_i Y p in the camera's frame, where A_i is T_i
or its inverse. X and Y are found together by minimising the distance of all corners in all pictures from where they are
seen (least squares with a soft L1 loss), starting from the closed form of Park and Martin (1994), which alone is
several times less accurate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal

import attrs
import cv2
import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from memo_core.plugin import Array, MemoError, Pose, quaternion_from_rotation
from memo_perception.calibration.board import Board, Lens, Sighting

Mount = Literal["world", "hand"]
Moving = Literal["camera", "board"]
Movement = tuple[Moving, Array]

LEAST_SHOTS = 10
LARGEST_ERROR = 0.005  # m, held out
LARGEST_TURN = np.deg2rad(1.0)  # rad, held out
_LEAST_SPREAD = np.deg2rad(5.0)  # rad, of the hand's rotations about the second of their axes
_FLAT = 1 / 1000  # of the focal length: px by which the corners of a flat board lie off
_SCALE = 0.005  # share by which the squares may measure more or less than they should
_SIGNIFICANT = 4.0  # standard deviations
_DOUBTFUL = 1 / 1200  # of the focal length: px from which on it is worth asking whether something moved
_EXPLAINED = 0.5  # share of the squared error that a movement must explain
_MOVED = (0.002, np.deg2rad(0.2))  # m, rad: smaller movements are not told from noise
_FEWEST_AFTER = 3  # shots on either side of a movement
_FOLDS = 5
_METHODS = (cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_HORAUD, cv2.CALIB_HAND_EYE_TSAI)


@attrs.define(auto_exc=True, eq=False)
class BadCalibration(MemoError):
    """Pictures from which no trustworthy calibration follows: the reason, and what to do about it. ``cause`` is one of
    ``few-poses``, ``alike-poses``, ``not-flat``, ``wrong-size``, ``camera-moved``, ``board-moved``, ``inaccurate``."""

    cause: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"no calibration: {self.problem} ({self.remedy})"


@attrs.frozen(eq=False)
class Shot:
    """One picture of the board: its name, the tool's pose in the base frame, and the corners found."""

    name: str
    tool: Pose
    sighting: Sighting


@attrs.frozen
class HandEye:
    """A calibration. Errors are root mean squares over shots that were left out of the fit, a fifth at a time."""

    mount: Mount
    camera: Pose  # in the base frame, or for a camera on the hand in the tool frame; +z forward, +y down
    board: Pose  # in the tool frame, or for a camera on the hand in the base frame
    shots: int
    pixels: float  # root mean square distance of the corners from where they should be
    position_error: float  # m, of the board's middle in one such shot; includes the error of seeing it once
    rotation_error: float  # rad, by which such shots would turn the camera
    position_deviation: float  # m, standard deviation of the camera's position (jackknife over the folds)
    rotation_deviation: float  # rad, the same of its orientation


def calibrate(shots: Sequence[Shot], board: Board, lens: Lens, mount: Mount) -> HandEye:
    """Find where the camera is. ``shots`` in the order in which they were taken. Raises ``BadCalibration``."""
    with threadpool_limits(1):  # for small matrices several threads mostly wait for each other
        return _calibrate(shots, board, lens, mount)


def _calibrate(shots: Sequence[Shot], board: Board, lens: Lens, mount: Mount) -> HandEye:
    if len(shots) < LEAST_SHOTS:
        given = f"{len(shots)} pictures show the board, at least {LEAST_SHOTS} are needed"
        raise BadCalibration("few-poses", given, "more poses of the arm; 25 are good")
    _check_spread(shots)
    focal = float(lens.matrix[0, 0])
    off = [board.residual(shot.sighting, lens, board.pose(shot.sighting, lens)) for shot in shots]
    if np.median(off) > _FLAT * focal:
        told = f"within single pictures the board's corners are {np.median(off):.1f} px from where a flat board's are"
        raise BadCalibration("not-flat", told, "a board glued to something rigid, and the camera's own intrinsics")
    fit = _Fit(shots, board, lens, mount)
    solution = fit.solve(fit.start())
    _check_size(fit, solution, board)
    if _rms(solution) > _DOUBTFUL * focal:
        _check_still(fit, solution)
    found = _held_out(fit, solution)
    if found.position_error > LARGEST_ERROR or found.rotation_error > LARGEST_TURN:
        told = f"on pictures left out it is off by {_error(found)}, at most {1000 * LARGEST_ERROR:.0f} mm and 1 degree"
        worst = shots[int(np.argmax(fit.by_shot(solution.x)))].name
        remedy = f"is the board fixed firmly, and does the arm know its tool's pose? the worst picture is {worst}"
        raise BadCalibration("inaccurate", told, remedy)
    if found.position_deviation > LARGEST_ERROR:
        told = f"the camera's position is uncertain by {1000 * found.position_deviation:.1f} mm"
        raise BadCalibration("alike-poses", told, "more poses, turned further about different axes")
    return found


class _Fit:
    """The least-squares problem. Parameters: X^-1 and Y as rotation vectors and translations, 12 numbers; further ones
    are the board's scale minus 1, or the movement (6) of the camera or the board before a shot."""

    def __init__(self, shots: Sequence[Shot], board: Board, lens: Lens, mount: Mount) -> None:
        self.shots, self.board, self.lens, self.mount = shots, board, lens, mount
        self.arm = [shot.tool if mount == "world" else shot.tool.inverse() for shot in shots]
        numbers = [np.full(len(shot.sighting.corners), i) for i, shot in enumerate(shots)]
        self._shot = np.concatenate(numbers)  # of each corner
        self._points = np.concatenate([board.points[shot.sighting.corners] for shot in shots])
        self._pixels = np.concatenate([shot.sighting.pixels for shot in shots])
        self._turns = np.array([pose.rotation for pose in self.arm])
        self._shifts = np.array([pose.position for pose in self.arm])

    def start(self) -> Array:
        """Parameters of the best closed form, poses of the board chosen so that they agree with it."""
        seen = [self.board.pose(shot.sighting, self.lens) for shot in self.shots]
        best = min((self._closed_form(seen, method) for method in _METHODS), key=self._misfit)
        camera, board = _pose(best[:6]), _pose(best[6:12])
        seen = [
            self.board.pose(shot.sighting, self.lens, camera * arm * board)
            for shot, arm in zip(self.shots, self.arm, strict=True)
        ]
        return min((best, self._closed_form(seen, cv2.CALIB_HAND_EYE_PARK)), key=self._misfit)

    def _closed_form(self, seen: Sequence[Pose], method: int) -> Array:
        back = [pose.inverse() for pose in self.arm]
        turn, shift = cv2.calibrateHandEye(
            [pose.rotation for pose in back],
            [np.array(pose.position) for pose in back],
            [pose.rotation for pose in seen],
            [np.array(pose.position) for pose in seen],
            method=method,  # by keyword: positional it would be taken for an output
        )
        if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
            return np.full(12, np.nan)
        camera = Pose(tuple(np.ravel(shift)), quaternion_from_rotation(np.asarray(turn, dtype=float)))
        boards = [arm * camera * pose for arm, pose in zip(back, seen, strict=True)]
        middle = np.median([board.position for board in boards], axis=0)
        board = min(boards, key=lambda one: float(np.linalg.norm(np.asarray(one.position) - middle)))
        return np.concatenate([_parameters(camera.inverse()), _parameters(board)])

    def _misfit(self, parameters: Array) -> float:
        if not np.isfinite(parameters).all():
            return np.inf
        return float(np.median(np.abs(self.residuals(parameters))))

    def residuals(self, x: Array, scale: float = 1.0, moved: Movement | None = None) -> Array:
        """Pixels by which each corner is off, flat. ``moved``: how the camera or the board has moved in each shot
        (shots, 6) from where it is in X or Y, in its own frame."""
        what, by = moved or ("", np.zeros(0))
        points = self._points * scale
        if what == "board":
            points = _moved(points, by, self._shot)
        points = points @ _turn(x[6:9]).T + x[9:12]
        points = np.einsum("nij,nj->ni", self._turns[self._shot], points) + self._shifts[self._shot]
        points = points @ _turn(x[:3]).T + x[3:6]
        if what == "camera":
            points = _moved(points, by, self._shot)
        points[:, 2] = np.maximum(points[:, 2], 1e-3)  # behind the camera there is no picture: a large error instead
        return (self.lens.project(points) - self._pixels).ravel()

    def solve(self, start: Array) -> OptimizeResult:
        return _least_squares(self.residuals, start)

    def solve_scale(self, start: Array) -> OptimizeResult:
        return _least_squares(lambda x: self.residuals(x, 1.0 + x[12]), np.append(start[:12], 0.0))

    def movement(self, what: Moving, by: Array, first: int = 0) -> Movement:
        """``what`` moved by ``by`` (6,) before shot number ``first``, as ``residuals`` takes it."""
        return what, (np.arange(len(self.shots)) >= first)[:, None] * by[None]

    def solve_moved(self, start: Array, what: Moving, first: int) -> OptimizeResult:
        """``what`` is somewhere else from shot number ``first`` on."""
        return _least_squares(
            lambda x: self.residuals(x, moved=self.movement(what, x[12:], first)), np.append(start[:12], np.zeros(6))
        )

    def likeliest_movement(self, x: Array) -> tuple[Moving, int]:
        """What moved before which shot, if something did: by the linearised problem at the parameters ``x``."""
        off = self.residuals(x)
        fixed = _jacobian(self.residuals, x)
        found: list[tuple[float, Moving, int]] = []
        kinds: tuple[Moving, ...] = ("camera", "board")
        for what in kinds:
            moving = _jacobian(partial(self._off_when_moved, x, what), np.zeros(6))
            for first in range(_FEWEST_AFTER, len(self.shots) - _FEWEST_AFTER + 1):
                after = np.repeat(self._shot >= first, 2)[:, None]
                columns = np.hstack([fixed, moving * after])
                step = np.linalg.lstsq(columns, -off, rcond=None)[0]
                found.append((float(((off + columns @ step) ** 2).sum()), what, first))
        _, what, first = min(found)
        return what, first

    def _off_when_moved(self, x: Array, what: Moving, by: Array) -> Array:
        return self.residuals(x, moved=self.movement(what, by))

    def of(self, numbers: Sequence[int]) -> _Fit:
        """The same problem with some of the shots."""
        return _Fit([self.shots[number] for number in numbers], self.board, self.lens, self.mount)

    def camera_off(self, x: Array) -> float:
        """Angle (rad) by which these shots alone would turn the camera."""
        turned = _least_squares(partial(self._off_when_moved, x, "camera"), np.zeros(6))
        return float(np.linalg.norm(turned.x[:3]))

    def by_shot(self, x: Array) -> Array:
        """Mean squared error of each shot, shape (shots,)."""
        squares = (self.residuals(x).reshape(-1, 2) ** 2).sum(axis=1)
        return np.bincount(self._shot, squares) / np.bincount(self._shot)

    def board_off(self, x: Array, number: int) -> float:
        """Distance (m) between the board's middle as seen in one shot alone and where the calibration puts it."""
        expected = _pose(x[:6]) * self.arm[number] * _pose(x[6:12])
        seen = self.board.pose(self.shots[number].sighting, self.lens, expected)
        return seen.distance(expected)[0]


def _check_spread(shots: Sequence[Shot]) -> None:
    """The hand must turn about at least two axes, or part of the camera's position cannot be told."""
    turns = Rotation.from_matrix([shot.tool.rotation for shot in shots])
    vectors = (turns.mean().inv() * turns).as_rotvec()
    spread = np.linalg.svd(vectors / np.sqrt(len(shots)), compute_uv=False)
    if spread[1] < _LEAST_SPREAD:
        told = f"the hand turns by only {np.degrees(spread[1]):.1f} degrees about a second axis"
        raise BadCalibration("alike-poses", told, "poses turned by 20 to 40 degrees about different axes")


def _check_size(fit: _Fit, solution: OptimizeResult, board: Board) -> None:
    """The arm's motion shows how large the board really is."""
    scaled = fit.solve_scale(solution.x)
    scale, deviation = 1.0 + scaled.x[12], _deviations(scaled, len(fit.shots))[12]
    if abs(scale - 1.0) > max(_SCALE, _SIGNIFICANT * deviation):
        told = f"the board's squares seem to measure {1000 * scale * board.square:.2f} mm, not {1000 * board.square:g}"
        raise BadCalibration("wrong-size", told, "measure them; if they are right, the camera's intrinsics are not")


def _check_still(fit: _Fit, solution: OptimizeResult) -> None:
    """Whether one sudden movement of the camera or the board explains most of the error. Every shot is tried as the
    first one after it, in the linearised problem; the best candidate is then solved for."""
    whole = float((fit.residuals(solution.x) ** 2).sum())
    what, first = fit.likeliest_movement(solution.x)
    moved = fit.solve_moved(solution.x, what, first)
    by = moved.x[12:]
    left = float((fit.residuals(moved.x, moved=fit.movement(what, by, first)) ** 2).sum())
    far, turned = float(np.linalg.norm(by[3:])), float(np.linalg.norm(by[:3]))
    if left < (1 - _EXPLAINED) * whole and (far > _MOVED[0] or turned > _MOVED[1]):
        told = f"the {what} moved before {fit.shots[first].name}, by about {_amount(far, turned)}"
        raise BadCalibration(f"{what}-moved", told, f"fix the {what} and take the pictures again")


def _held_out(fit: _Fit, solution: OptimizeResult) -> HandEye:
    count = len(fit.shots)
    far: list[float] = []
    turned: list[float] = []
    cameras: list[Pose] = []
    for fold in range(_FOLDS):
        left_out = list(range(fold, count, _FOLDS))
        x = fit.of([number for number in range(count) if number not in left_out]).solve(solution.x).x
        far += [fit.board_off(x, number) for number in left_out]
        turned.append(fit.of(left_out).camera_off(x))
        cameras.append(_pose(x[:6]).inverse())
    camera = _pose(solution.x[:6]).inverse()
    spread = np.array([one.distance(camera) for one in cameras])
    deviation = np.sqrt((_FOLDS - 1) * (spread**2).mean(axis=0))
    return HandEye(
        fit.mount,
        camera,
        _pose(solution.x[6:12]),
        count,
        _rms(solution),
        float(np.sqrt(np.square(far).mean())),
        float(np.sqrt(np.square(turned).mean())),
        float(deviation[0]),
        float(deviation[1]),
    )


# -- numbers -----------------------------------------------------------------------------------------------------------


def _least_squares(residuals: Callable[[Array], Array], start: Array) -> OptimizeResult:
    """``fun`` of the result are the residuals themselves, without the loss."""
    return least_squares(residuals, start, x_scale="jac", loss="soft_l1", f_scale=2.0, max_nfev=40, ftol=1e-6)


def _jacobian(residuals: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    here = residuals(at)
    return np.column_stack([(residuals(at + step * unit) - here) / step for unit in np.eye(len(at))])


def _deviations(solution: OptimizeResult, shots: int) -> Array:
    """Standard deviations of the parameters. What the arm is off by is the same for all corners of a shot, so that a
    shot counts as its six degrees of freedom and not as its corners."""
    independent = max(1, 6 * shots - len(solution.x))
    noise = float((solution.fun**2).sum()) / independent
    covariance = np.linalg.pinv(solution.jac.T @ solution.jac) * noise
    return np.sqrt(np.diag(covariance))


def _rms(solution: OptimizeResult) -> float:
    return float(np.sqrt(2 * (solution.fun**2).mean()))  # two numbers a corner


def _turn(vector: Array) -> Array:
    return Rotation.from_rotvec(vector).as_matrix()


def _moved(points: Array, by: Array, shot: np.ndarray) -> Array:
    """Points (n, 3), each moved by the rotation vector and translation (shots, 6) of its shot (n,)."""
    turns = Rotation.from_rotvec(by[:, :3]).as_matrix()[shot]
    return np.einsum("nij,nj->ni", turns, points) + by[shot, 3:]


def _parameters(pose: Pose) -> Array:
    return np.concatenate([Rotation.from_matrix(pose.rotation).as_rotvec(), pose.position])


def _pose(parameters: Array) -> Pose:
    return Pose(tuple(parameters[3:6]), quaternion_from_rotation(_turn(parameters[:3])))


def _amount(far: float, turned: float) -> str:
    return f"{1000 * far:.1f} mm and {np.degrees(turned):.2f} degrees"


def _error(found: HandEye) -> str:
    return _amount(found.position_error, found.rotation_error)
