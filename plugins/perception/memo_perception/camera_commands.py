"""``memo cameras``: print a board, calibrate a camera with it, check a calibration, record what cameras see."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli import ConfigFile, Json, Overrides, load, note, print_json, print_table
from memo_core.plugin import BackendUnavailable, InvalidArgument

if TYPE_CHECKING:
    from memo_perception.calibration.board import Board
    from memo_perception.calibration.file import Calibration
    from memo_perception.calibration.hand_eye import Mount
    from memo_perception.calibration.rig import Rig

app = typer.Typer(help="Cameras: print a board, calibrate, check, record.")

_DOTS_PER_MM = 12  # about 300 dpi


class Where(StrEnum):
    """Where the board is: in the hand (the camera is fixed) or on the table (the camera is on the hand)."""

    HAND = "hand"
    TABLE = "table"


Squares = Annotated[str, typer.Option("--squares", metavar="CxR", help="Columns and rows of the board.")]
Square = Annotated[float, typer.Option("--square", metavar="MM", help="Side of a square, measured on the print.")]
Marker = Annotated[float, typer.Option("--marker", metavar="MM", help="Side of a marker; none: 3/4 of the square.")]
Dictionary = Annotated[str, typer.Option("--dictionary", help="Of the markers, e.g. 4x4_50 or apriltag_36h11.")]


@app.command()
def board(
    out: Annotated[Path, typer.Option("--out", "-o", help="PNG file to write.")] = Path("board.png"),
    squares: Squares = "7x5",
    square: Square = 30.0,
    marker: Marker = 0.0,
    dictionary: Dictionary = "4x4_50",
) -> None:
    """Write a ChArUco board to be printed, at the resolution that makes its squares as large as asked for."""
    from PIL import Image

    made = _board(squares, square, marker, dictionary)
    picture = Image.fromarray(made.drawn(round(square * _DOTS_PER_MM)))
    try:
        picture.save(out, dpi=(_DOTS_PER_MM * 25.4,) * 2)
    except (OSError, ValueError) as error:
        raise InvalidArgument("--out", f"{out}: {error}", "a .png file that can be written") from None
    wide, high = (1000 * side for side in made.size)
    print(f"{out}: {wide:g} x {high:g} mm. Print it unscaled, glue it to something rigid, measure a square.")


@app.command()
def calibrate(
    camera: Annotated[str, typer.Argument(help="Name of the camera.")],
    on: Annotated[Where, typer.Option("--board", help="hand: the camera is fixed; table: it is on the hand.")],
    squares: Squares = "7x5",
    square: Square = 30.0,
    marker: Marker = 0.0,
    dictionary: Dictionary = "4x4_50",
    poses: Annotated[int, typer.Option("--poses", min=1, max=200, help="Pictures to take.")] = 25,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; none: CAMERA.json.")] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before the arm moves.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Find where a camera is, with a ChArUco board in the hand or on the table.

    Bring the arm to where the board is in view; it then moves slowly through poses around there. In simulation the
    board is drawn into the pictures. Nothing is written if the error on pictures left out exceeds 5 mm.
    """
    from memo_core.cli import confirmed
    from memo_perception.calibration.file import Calibration, save
    from memo_perception.calibration.hand_eye import calibrate as solve
    from memo_perception.calibration.rig import rig_of
    from memo_perception.calibration.session import take_shots

    made = _board(squares, square, marker, dictionary)
    mount: Mount = "world" if on is Where.HAND else "hand"
    file = out or Path(f"{camera}.json")
    _, experiment = load(config, overrides)
    with rig_of(experiment) as rig:
        capture = rig.with_board(camera, made, mount)
        if rig.world is None:
            around = "The arm moves slowly around where it stands; it knows of nothing but itself and its workspace."
            confirmed(around, yes)
        session = take_shots(rig.link, rig.kinematics, rig.proposals(made, mount), poses, capture, made, note)
        truth = rig.true_pose(camera, mount)
        robot = rig.robot
    if session.first is None:
        given = f"{session.missed} pictures without the board"
        raise InvalidArgument("the board", given, f"a board of {squares} squares ({dictionary}) in view")
    lens = _lens(session.first)
    found = solve(session.shots, made, lens, mount)
    when = datetime.now().astimezone().isoformat(timespec="seconds")
    size, intrinsics = session.first.size, session.first.intrinsics
    save(Calibration(camera, robot, when, size, intrinsics, made, found), file)
    told: dict[str, Any] = {
        "camera": camera,
        "file": str(file),
        "mount": mount,
        "position": list(found.camera.position),
        "orientation": list(found.camera.orientation),
        "pictures": found.shots,
        "missed": session.missed,
        "held_out_mm": 1000 * found.position_error,
        "held_out_degrees": _degrees(found.rotation_error),
        "deviation_mm": 1000 * found.position_deviation,
        "reprojection_px": found.pixels,
    }
    if truth is not None:
        far, turned = found.camera.distance(truth)
        told |= {"true_error_mm": 1000 * far, "true_error_degrees": _degrees(turned)}
    if json:
        print_json(told)
        return
    print_table(("what", "value"), [(key.replace("_", " "), _shown(value)) for key, value in told.items()])


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Calibrations to check.")],
    remember: Annotated[bool, typer.Option("--remember", help="Write the tags seen now into the files.")] = False,
    size: Annotated[float, typer.Option("--size", metavar="MM", help="Side of the tags, with --remember.")] = 50.0,
    dictionary: Annotated[str, typer.Option("--dictionary", help="Of the tags, with --remember.")] = "apriltag_36h11",
    most: Annotated[float, typer.Option("--most", metavar="MM", help="Drift that is still all right.")] = 10.0,
    looks: Annotated[int, typer.Option("--looks", min=1, help="Pictures of each camera; medians count.")] = 5,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Whether cameras are still where they were calibrated: tags that do not move must seem to be where they were.

    Once, after calibrating: --remember. Exit code 1 if a tag has drifted further than --most, or none is seen. Nothing
    moves.
    """
    from memo_perception.calibration.file import load as read, save
    from memo_perception.calibration.rig import rig_of

    known = [(file, read(file)) for file in files]
    for file, one in known:
        if not remember and not one.tags:
            raise InvalidArgument(str(file), "knows no tag", "memo cameras check FILE --remember, once")
    _, experiment = load(config, overrides)
    rows: list[dict[str, Any]] = []
    with rig_of(experiment) as rig:
        for file, one in known:
            pictures, tool = _pictures(rig, one, looks)
            if remember:
                one = one.remember(pictures, tool, dictionary, size / 1000)
                if not one.tags:
                    raise BackendUnavailable("camera", one.camera, f"it sees no tag of {dictionary}", "put one in view")
                save(one, file)
            rows += _drifts(one, pictures, tool, most)
    if json:
        print_json({"tags": rows})
    else:
        print_table(
            ("camera", "tag", "state", "drift mm", "turned degrees"),
            [(row["camera"], row["tag"], row["state"], _shown(row["mm"]), _shown(row["degrees"])) for row in rows],
        )
    if any(row["state"] != "ok" for row in rows):
        raise typer.Exit(1)


@app.command()
def record(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the recording; looks are added to it.")],
    looks: Annotated[int, typer.Option("--looks", min=1, help="How many looks to record.")] = 1,
    every: Annotated[float, typer.Option("--every", min=0.0, help="Seconds between two looks.")] = 1.0,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Record what the cameras see: colour, depth, intrinsics and poses, for perception.source=folder. Nothing moves."""
    import time

    from memo_core.cli import progress_bar
    from memo_perception.calibration.rig import rig_of
    from memo_perception.cameras.sources.folder import write_look

    _, experiment = load(config, overrides)
    written: list[str] = []
    with rig_of(experiment, calibrated=True) as rig, progress_bar() as progress:
        bar = progress.add_task("recording", total=looks)
        for _ in range(looks):
            if written:
                time.sleep(every)
            frames = rig.source.capture()
            try:
                written.append(str(write_look(out, frames)))
            except OSError as error:
                raise InvalidArgument("--out", f"{out}: {error.strerror or error}", "a folder to write to") from None
            progress.advance(bar)
    if json:
        print_json({"looks": written})
    else:
        print(f"{len(written)} looks in {out}; see them with perception.source=folder perception.folder.path={out}")


def _drifts(calibration: Calibration, pictures: list[Any], tool: Any, most: float) -> list[dict[str, Any]]:
    found = {(one.tag.dictionary, one.tag.number): one for one in calibration.drifts(pictures, tool)}
    rows = []
    for tag in calibration.tags:
        row: dict[str, Any] = {
            "camera": calibration.camera,
            "tag": f"{tag.dictionary} {tag.number}",
            "mm": None,
            "degrees": None,
        }
        drift = found.get((tag.dictionary, tag.number))
        if drift is None:
            rows.append(row | {"state": "not seen"})
            continue
        turned = None if drift.turned is None else _degrees(drift.turned)
        state = "ok" if 1000 * drift.distance <= most else "drifted"
        rows.append(row | {"state": state, "mm": 1000 * drift.distance, "degrees": turned})
    return rows


def _pictures(rig: Rig, calibration: Calibration, looks: int) -> tuple[list[Any], Any]:
    return [rig.frame(calibration.camera).rgb for _ in range(looks)], rig.tool()


def _board(squares: str, square: float, marker: float, dictionary: str) -> Board:
    from memo_perception.calibration.board import Board

    columns, _, rows = squares.lower().partition("x")
    if not (columns.isdecimal() and rows.isdecimal() and 3 <= int(columns) <= 30 and 3 <= int(rows) <= 30):
        raise InvalidArgument("--squares", repr(squares), "columns x rows, 3 to 30 each, such as 7x5")
    if not 1.0 <= square <= 500.0:
        raise InvalidArgument("--square", f"{square:g} mm", "1 to 500 mm")
    return Board(int(columns), int(rows), square / 1000, (marker or 0.75 * square) / 1000, dictionary)


def _lens(frame: Any) -> Any:
    from memo_perception.calibration.board import Lens

    return Lens(frame.intrinsics.matrix)


def _degrees(angle: float) -> float:
    return angle * 57.29577951308232


def _shown(value: Any) -> Any:
    if isinstance(value, float):
        return f"{value:.2f}"
    return ", ".join(f"{one:.4f}" for one in value) if isinstance(value, list) else value
