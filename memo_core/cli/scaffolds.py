"""The plugins that ``memo new`` writes: a folder of ``skeletons`` a kind, rendered with the plugin's name."""

from __future__ import annotations

import builtins
import keyword
import os
import re
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_core.plugins.installing import install
from memo_core.robot.urdf.reading import find_mesh, read_urdf, with_meshes_found
from memo_core.robot.urdf.units import check_units
from memo_core.robot.urdf.xacro_expansion import expand_xacro, is_xacro


@attrs.frozen
class Scaffold:
    """One kind of plugin that can be written. ``next`` are the commands to try then, with ``{name}``."""

    kind: str  # as after `memo new`
    backend_kind: str  # as in a config; empty for a command
    hook: str
    title: str
    about: str
    dependencies: tuple[str, ...] = ()
    next: tuple[str, ...] = ()
    package: bool = False  # a folder rather than one module

    def check_name(self, name: str) -> None:
        """Raise ``InvalidArgument`` for a name that cannot be that of a distribution, a module and a backend."""
        if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
            expected = "lower case and hyphens, beginning with a letter, such as " + (
                _hyphenated(name) or "lift-the-block"
            )
            raise InvalidArgument("NAME", f"{name!r} is no name of a {self.kind}", expected)
        if self.kind in ("skills", "robot") and keyword.iskeyword(name.replace("-", "_")):
            raise InvalidArgument("NAME", f"{name!r} is a word of Python, and it names a function", "another word")


@attrs.frozen
class Written:
    """The files of a new plugin, and what its author should know, a line each."""

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


_ARRAYS = ("numpy>=2",)
_SETTINGS = ("attrs>=25",)
_CHECK = "memo plugins check {kind}/{{name}}"


def _scaffold(kind: str, backend_kind: str, hook: str, title: str, about: str, then: str, *needs: str) -> Scaffold:
    first = _CHECK.format(kind=backend_kind)
    return Scaffold(kind, backend_kind, hook, title, about, needs, (first, then))


SCAFFOLDS = {
    one.kind: one
    for one in (
        Scaffold(
            "task",
            "suite",
            "memo_task_suites",
            "A task",
            "Write a plugin with one task: a scene, an instruction, a success check, a reference solution.",
            _ARRAYS,
            (
                "memo tasks verify --suite {name} --seeds 0-4",
                _CHECK.format(kind="suite"),
                "memo run --task {name} --set suite.backend={name}",
            ),
        ),
        _scaffold(
            "suite",
            "suite",
            "memo_task_suites",
            "A task suite",
            "Write a plugin with a suite of tasks: settings, a monitor, one task.",
            "memo tasks verify --suite {name} --seeds 0-4",
            *_SETTINGS,
            *_ARRAYS,
        ),
        _scaffold(
            "llm",
            "llm",
            "memo_language_models",
            "A language model",
            "Write a plugin with a language backend.",
            "memo run --task open-the-fridge --set llm.backend={name}",
            *_SETTINGS,
        ),
        _scaffold(
            "embedder",
            "embedder",
            "memo_embedders",
            "An embedder",
            "Write a plugin with a sentence embedder.",
            "memo run --task open-the-fridge --book new.db --set embedder.backend={name}",
            *_SETTINGS,
            *_ARRAYS,
        ),
        _scaffold(
            "vectorstore",
            "vectorstore",
            "memo_vector_stores",
            "A vector store",
            "Write a plugin with a vector store.",
            "memo run --task open-the-fridge --set vectorstore.backend={name}",
            *_ARRAYS,
        ),
        _scaffold(
            "simulator",
            "simulator",
            "memo_simulators",
            "A simulator",
            "Write a plugin with a simulator that hands every call to another one.",
            "memo tasks verify open-the-fridge --seeds 0-4 --set simulator.backend={name}",
            *_SETTINGS,
        ),
        Scaffold(
            "robot",
            "robot",
            "memo_robots",
            "A robot",
            "Write a plugin with a robot read from a URDF, and say what was guessed.",
            _SETTINGS,
            (
                "memo plugins check robot/{name}",
                "memo tasks verify stack-the-cubes --seeds 0-4 --set robot.backend={name}",
            ),
            package=True,
        ),
        _scaffold(
            "driver",
            "robot_driver",
            "memo_robot_drivers",
            "A robot driver",
            "Write a plugin with a robot driver: what moves a described arm.",
            "memo robot check --set robot.driver={name}",
            *_SETTINGS,
            *_ARRAYS,
        ),
        _scaffold(
            "gripper",
            "gripper_driver",
            "memo_gripper_drivers",
            "A gripper driver",
            "Write a plugin with a driver for a gripper that has a connection of its own.",
            "memo config show --set robot.gripper_driver={name}",
            *_SETTINGS,
        ),
        _scaffold(
            "perception",
            "perception",
            "memo_perceptions",
            "Perception",
            "Write a plugin with a perception backend that filters what another one sees.",
            "memo run --task open-the-fridge --set perception.backend={name}",
            *_SETTINGS,
        ),
        _scaffold(
            "teacher",
            "teacher",
            "memo_teachers",
            "A teacher",
            "Write a plugin with a teacher: whoever watches and may speak.",
            "memo run --task open-the-fridge --teacher {name}",
            *_SETTINGS,
        ),
        _scaffold(
            "skills",
            "skills",
            "memo_skills",
            "Skills",
            "Write a plugin with further skills for robot code.",
            "memo prompts show code --set skills={name}",
        ),
        _scaffold(
            "method",
            "method",
            "memo_methods",
            "A method",
            "Write a plugin with a method: what does a task, given everything.",
            "memo run --task open-the-fridge --set method.backend={name}",
        ),
        Scaffold(
            "command",
            "",
            "",
            "A command",
            "Write a plugin that adds a command to memo.",
            ("typer>=0.20",),
            ("memo {name}",),
        ),
    )
}


@attrs.frozen
class RobotSource:
    """The file that a robot is read from, with the arguments of a xacro file, and the folders besides its own to find
    meshes and ROS packages in. ``plain_hand`` takes the place of its gripper;
    ``total_mass`` (kg) is divided among the links that state no mass."""

    urdf: Path
    arguments: Mapping[str, str] = attrs.field(factory=dict)
    mesh_folders: tuple[Path, ...] = ()
    skip_missing_meshes: bool = False
    plain_hand: bool = False
    total_mass: float | None = None

    def read(self) -> tuple[str, tuple[str, ...]]:
        """URDF text whose meshes can be found, and, a line each, what had to be changed for that."""
        for folder in self.mesh_folders:
            if not folder.is_dir():
                raise InvalidArgument("--mesh-folder", f"{folder} is no folder", "one that holds meshes")
        folders = [self.urdf.resolve().parent, *(folder.resolve() for folder in self.mesh_folders)]
        text, near = self._text(), [str(folder) for folder in folders]
        try:
            found = with_meshes_found(text, near, self.skip_missing_meshes)
        except InvalidArgument as missing:
            _check_the_rest(with_meshes_found(text, near, skip_missing=True).text, near[0], missing)
            raise
        places = dict.fromkeys((name.rpartition("/")[0], str(path.parent)) for name, path in found.moved)
        lines = [f"meshes of {named} found in {place}" for named, place in places]
        lines += [f"visual left out, its mesh was not found (--mesh-folder DIR): {name}" for name in found.unseen]
        lines += [f"collision shape left out, nothing keeps clear of it: {name}" for name in found.untouched]
        return found.text, tuple(lines)

    def _text(self) -> str:
        try:
            text = self.urdf.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidArgument("--urdf", f"{self.urdf} cannot be read ({error})", "a URDF file") from None
        if is_xacro(self.urdf, text):
            return expand_xacro(self.urdf, self.arguments, self.mesh_folders, install("memo-core[xacro]"))
        if self.arguments:
            raise InvalidArgument(next(iter(self.arguments)), f"{self.urdf} is no xacro and takes no arguments")
        return text


def write_scaffold(kind: str, name: str, folder: Path, urdf: Path | RobotSource | None = None) -> Written:
    """Write a plugin of a kind into a folder, which is made. ``urdf`` is what a robot is read from; None: an
    example arm. Raises ``InvalidArgument`` where the folder cannot be written or the URDF not be read."""
    scaffold = SCAFFOLDS[kind]
    scaffold.check_name(name)
    source = RobotSource(urdf) if isinstance(urdf, Path) else urdf
    files, copies, notes = _robot_files(name, source) if kind == "robot" else (rendered(kind, name), {}, ())
    written = []
    try:
        for target, text in files.items():
            path = folder / target
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            written.append(path)
        for target, file in copies.items():
            path = folder / target
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, path)
    except OSError as error:
        raise InvalidArgument("--folder", f"{folder}: {error.strerror}", "a folder that can be written") from None
    if kind == "task":
        item, place = _things(name)
        shown = f"a 4 cm block, called {item!r}, to put on a flat mat, called {place!r}"
        notes = (f"it is {shown}, so far: scene, goal, check and solution are yours to change",)
    if kind in ("driver", "gripper"):
        notes = ("memo plugins check connects to what answers at the driver's default address, and moves it",)
    return Written(tuple(written), notes)


def rendered(kind: str, name: str, **more: Any) -> dict[str, str]:
    """The texts of a new plugin's files, by path relative to its folder."""
    from jinja2 import Environment, StrictUndefined

    scaffold = SCAFFOLDS[kind]
    module = f"memo_{name.replace('-', '_')}"
    words = name.split("-")
    values = attrs.asdict(scaffold) | {
        "name": name,
        "words": " ".join(words),
        "instruction": " ".join(words),
        "module": module,
        "function": "_".join(words),
        "class_name": "".join(word.capitalize() for word in words),
        "dependencies": ("memo-core>=0.1,<0.2", *scaffold.dependencies),
    }
    if kind == "task":
        item, place = _things(name)
        values |= {"item": item, "item_body": item.replace(" ", "_")}
        values |= {"place": place, "place_body": place.replace(" ", "_")}
        values |= {"item_name": _variable(item, "item"), "place_name": _variable(place, "place")}
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)
    skeletons = resources.files("memo_core.cli.skeletons")

    def render(*candidates: str) -> str:
        for one in candidates:
            file = skeletons.joinpath(one)
            if file.is_file():
                return environment.from_string(file.read_text(encoding="utf-8")).render(values | more)
        return ""

    source = f"{module}/__init__.py" if scaffold.package else f"{module}.py"
    return {
        "pyproject.toml": render("pyproject.toml.j2"),
        source: render(f"{kind}/module.py.j2"),
        f"test_{module}.py": render(f"{kind}/test.py.j2", "test.py.j2") + render(f"{kind}/more.py.j2"),
    }


_ONTO = "on|onto|in|into|to|under|at|from"
_PLACED = re.compile(rf"([a-z0-9-]+-)?the-(?P<item>[a-z0-9-]+?)-(?:{_ONTO})-the-(?P<place>[a-z0-9-]+)")
_ONE_THING = re.compile(r"([a-z0-9-]+-)?the-(?P<item>[a-z0-9-]+)")
_USED = frozenset(
    [
        "world",
        "monitors",
        "rng",
        "np",
        "x",
        "y",
        "middle",
        "height",
        "low",
        "high",
        "away",
        "touching",
        "contact",
        "name",
        "self",
        "bodies",
        "task",
    ]
)


def _things(name: str) -> tuple[str, str]:
    """What a task of this name moves, and where to: put-the-cup-on-the-saucer gives cup and saucer."""
    match = _PLACED.fullmatch(name) or _ONE_THING.fullmatch(name)
    named = {} if match is None else match.groupdict()
    item, place = (named.get(key, usual).replace("-", " ") for key, usual in (("item", "block"), ("place", "mat")))
    return (item, place) if item != place else (item, f"other {place}")


def _variable(label: str, otherwise: str) -> str:
    """A thing's name as a variable of Python."""
    word = re.sub(r"\W", "_", label)
    usable = word.isidentifier() and not keyword.iskeyword(word) and not hasattr(builtins, word) and word not in _USED
    return word if usable else otherwise


def _robot_files(name: str, source: RobotSource | None) -> tuple[dict[str, str], dict[str, Path], tuple[str, ...]]:
    """The texts of a new robot's files and the meshes to copy, by path, and what its author should know."""
    if source is None:
        text = resources.files("memo_core.cli.skeletons").joinpath("robot/example.urdf").read_text(encoding="utf-8")
        meshes: str | None = None
        found: tuple[str, ...] = ()
    else:
        text, found = source.read()
        meshes = str(source.urdf.resolve().parent)
    try:
        from memo_core.arm.description_from_urdf import describe_urdf
    except ModuleNotFoundError as error:
        raise InvalidArgument("robot", f"reading a URDF needs {error.name}", "memo-core with its extra `arm`") from None
    hand, mass = (False, None) if source is None else (source.plain_hand, source.total_mass)
    described = describe_urdf(text, name, meshes, hand, mass)
    package, urdf, copies = f"memo_{name.replace('-', '_')}", described.robot.urdf, dict[str, Path]()
    if meshes is not None and "<mesh" in urdf:
        urdf, copies = _with_own_meshes(urdf, meshes)
    code = described.source()
    more = {"read": described.read, "source": code, "meshes": bool(copies), "turned": described.turned}
    names = ("GripperDescription", "JointDescription", "RobotDescription")
    used = [name for name in names if f"{name}(" in code] + (["turned_by"] if described.turned else [])
    more["imports"] = ", ".join(sorted(["Backend", "Mounting", "Pose", "hookimpl", *used]))
    files = rendered("robot", name, **more)
    files[f"{package}/{name}.urdf"] = urdf
    notes = [*described.read, *found, *(f"guessed {one.what}: {one.value} ({one.why})" for one in described.guessed)]
    if copies:
        notes.append(f"{len(copies)} meshes copied to {package}/meshes; their licence is that of the URDF's maker")
    return files, {f"{package}/{target}": file for target, file in copies.items()}, tuple(notes)


def _check_the_rest(text: str, folder: str, missing: InvalidArgument) -> None:
    """Raise ``missing`` together with what else is wrong in a URDF, read without the meshes that are missing."""
    try:
        check_units(text, read_urdf(text, folder))
    except InvalidArgument as error:
        problem = f"{missing.problem}; apart from that, {error.argument}: {error.problem}"
        raise InvalidArgument(missing.argument, problem, f"{missing.expected}; {error.expected}") from None


def _with_own_meshes(urdf: str, folder: str) -> tuple[str, dict[str, Path]]:
    """The URDF text with its meshes in the plugin's folder ``meshes``, and the files to copy, by their path there."""
    root = ElementTree.fromstring(urdf)
    found = [(mesh, find_mesh("URDF", mesh.get("filename", ""), folder)) for mesh in root.iterfind(".//geometry/mesh")]
    above = os.path.commonpath([str(file.parent) for _, file in found])
    copies = {}
    for mesh, file in found:
        name = f"meshes/{file.relative_to(above)}"
        mesh.set("filename", name)
        copies[name] = file
    return ElementTree.tostring(root, encoding="unicode"), copies


def _hyphenated(name: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower())
    return re.sub(r"^[^a-z]+|-+$", "", words)
