"""``memo new KIND``: every plugin it writes installs, keeps the rules of its kind and passes its own tests."""

from __future__ import annotations

import importlib
import json
import math
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import click
import numpy as np
import pytest
import typer

from memo_core.arm.facing import facing
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.cli import app, scaffolds
from memo_core.cli.options import load
from memo_core.cli.scaffolds import SCAFFOLDS, RobotSource, rendered, write_scaffold
from memo_core.errors import InvalidArgument
from memo_core.interfaces.backend import KINDS
from memo_core.plugins.installing import install
from memo_core.plugins.registry import Registry
from memo_core.robot.mounting import base_pose
from memo_core.robot.urdf.reading import read_urdf
from memo_core.teachers.goal_check import unseen_goal
from memo_core.testing.perception import StillWorld
from memo_core.testing.plugins import check_backend
from tests.support.arms import facing_arm, six_joint_arm

PAGES = Path(__file__).parents[2] / "docs" / "plugins"
# page -> the scaffold that it shows
SHOWN = {
    "llm": ("llm", "parrot"),
    "embedder": ("embedder", "word-hash"),
    "vectorstore": ("vectorstore", "exact"),
    "robot_driver": ("driver", "echo"),
    "gripper_driver": ("gripper", "patient"),
    "perception": ("perception", "short-sighted"),
    "suite": ("suite", "lifting"),
    "teacher": ("teacher", "strict"),
    "skills": ("skills", "nudge-up"),
    "method": ("method", "look-only"),
    "command": ("command", "weather"),
}
PLUGINS = {kind: f"lab-{kind}" for kind in SCAFFOLDS}


def memo(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ | more)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """A folder with one plugin of each kind, and the metadata that an installer would have written for each."""
    folder = tmp_path_factory.mktemp("site")
    for kind, name in PLUGINS.items():
        project = tmp_path_factory.mktemp(kind)
        for file in write_scaffold(kind, name, project).files:
            target = folder / file.relative_to(project)
            if file.name == "pyproject.toml":
                described = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
                write_metadata(folder, described)
            else:
                target.parent.mkdir(exist_ok=True)
                target.write_bytes(file.read_bytes())
    return folder


def write_metadata(site: Path, project: dict) -> None:
    info = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    info.joinpath("METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0.1.0\nSummary: {project['description']}\n"
    )
    groups = project["entry-points"]
    lines = [
        line for group, points in groups.items() for line in (f"[{group}]", *(f"{n} = {v}" for n, v in points.items()))
    ]
    info.joinpath("entry_points.txt").write_text("\n".join(lines) + "\n")


def test_there_is_one_for_every_kind():
    assert {scaffold.backend_kind for scaffold in SCAFFOLDS.values()} == {*KINDS, ""}


@pytest.mark.sim
@pytest.mark.parametrize("kind", [kind for kind, scaffold in SCAFFOLDS.items() if scaffold.backend_kind])
def test_it_keeps_the_rules_of_its_kind(kind, site, monkeypatch):
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))
    registry = Registry()
    assert registry.problems == ()
    backend = registry.get(SCAFFOLDS[kind].backend_kind, PLUGINS[kind])
    results = list(check_backend(registry, backend))
    assert len(results) > 5
    # A simulator is not asked for pictures where none can be drawn.
    assert [r for r in results if r.outcome != "kept" and r.rule != "pictures_show_the_scene"] == []


@pytest.mark.process
def test_their_own_tests_pass(site):
    # The simulator's are the rules above, which take a while.
    deselected = "not (lab_simulator and not starts_at_home)"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n0", "-k", deselected, str(site)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=site)
    assert done.returncode == 0, done.stdout[-3000:]
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) > 50


def test_every_backend_is_to_be_checked_next():
    for scaffold in SCAFFOLDS.values():
        checked = f"memo plugins check {scaffold.backend_kind}/{{name}}" in scaffold.next
        assert checked is bool(scaffold.backend_kind), scaffold.kind


@pytest.mark.parametrize("kind", SCAFFOLDS)
def test_the_commands_to_try_next_are_commands_with_these_options(kind, site, monkeypatch):
    monkeypatch.syspath_prepend(str(site))
    for line in SCAFFOLDS[kind].next:
        program, *arguments = line.format(name=PLUGINS[kind]).split()
        assert program == "memo"
        command = typer.main.get_command(app._tree(arguments[0]))
        context = command.make_context("memo", arguments)
        while isinstance(command, click.Group):
            rest = [*context._protected_args, *context.args]
            if not rest:
                break  # of a plugin with one command, its group
            name, command, rest = command.resolve_command(context, rest)
            context = command.make_context(name, rest, parent=context)


@pytest.mark.parametrize(
    ("name", "item", "place"),
    [
        ("put-the-block-on-the-mat", "block", "mat"),
        ("stack-the-red-cup-on-the-saucer", "red cup", "saucer"),
        ("push-the-button", "button", "mat"),
        ("move-the-x-to-the-y", "x", "y"),
        ("put-the-list-in-the-class", "list", "class"),
        ("tidy-up", "block", "mat"),
    ],
)
def test_a_tasks_things_are_called_after_its_name(name, item, place):
    [source] = [text for file, text in rendered("task", name).items() if file.startswith("memo_")]
    scope: dict = {"__name__": "made"}
    exec(compile(source, name, "exec"), scope)
    [backend] = scope["memo_task_suites"]()
    [task] = backend.factory(None)
    scene = task.scene(np.random.default_rng(0))
    assert {body.label for body, _ in scene.walk()} == {item, place}
    assert task.goal == (f"the {item} is on the {place}", f"the hand has let go of the {item}")
    assert unseen_goal(task.goal, scene) == []
    world = StillWorld(scene)
    assert task.check(world, {}).reason.startswith(f"the {item} is ")


def test_meshes_are_copied_so_that_the_plugin_can_be_moved(tmp_path, monkeypatch):
    text = six_joint_arm().urdf.replace("</robot>", "")
    look = '<link name="look"><visual><geometry><mesh filename="look.stl"/></geometry></visual></link>'
    look += '<joint name="worn" type="fixed"><parent link="link1"/><child link="look"/></joint></robot>'
    (tmp_path / "arm.urdf").write_text(text + look)
    (tmp_path / "look.stl").write_bytes(b"\0" * 80 + (0).to_bytes(4, "little"))
    write_scaffold("robot", "lab-arm", tmp_path / "made", tmp_path / "arm.urdf")
    (tmp_path / "look.stl").unlink()
    monkeypatch.syspath_prepend(str(tmp_path / "made"))
    [backend] = importlib.import_module("memo_lab_arm").memo_robots()
    robot = backend.factory(backend.config())
    [shape] = read_urdf(robot.urdf, robot.mesh_folder).links["look"].visuals
    assert Path(shape.mesh) == tmp_path / "made" / "memo_lab_arm" / "meshes" / "look.stl"
    assert str(tmp_path) not in robot.urdf


def test_what_else_is_wrong_is_told_with_the_meshes_that_are_missing(tmp_path):
    text = six_joint_arm().urdf.replace("</robot>", "")
    look = '<link name="look"><collision><geometry><mesh filename="look.stl"/></geometry></collision></link>'
    look += '<joint name="worn" type="hinge"><parent link="link1"/><child link="look"/></joint></robot>'
    (tmp_path / "arm.urdf").write_text(text + look)
    with pytest.raises(InvalidArgument, match=r"look\.stl.*joint 'worn': has the type 'hinge'.*--skip-missing"):
        write_scaffold("robot", "lab-arm", tmp_path / "made", tmp_path / "arm.urdf")


def test_an_arm_that_faces_away_from_the_table_is_written_turned(tmp_path):
    (tmp_path / "arm.urdf").write_text(facing_arm(math.pi))
    written = write_scaffold("robot", "back-arm", tmp_path / "made", tmp_path / "arm.urdf")
    assert any("guessed base_rpy: [0, 0, 3.1416] (the arm faces -x" in line for line in written.notes)
    source = (tmp_path / "made" / "memo_back_arm" / "__init__.py").read_text()
    assert "base_rpy: list[float] = turned_by(0.0, 0.0, 3.1416)" in source
    sys.path.insert(0, str(tmp_path / "made"))
    try:
        [backend] = importlib.import_module("memo_back_arm").memo_robots()
        robot = backend.factory(backend.config())
    finally:
        sys.path.remove(str(tmp_path / "made"))
    assert facing(Kinematics(robot), robot.reach).side == "+x"


@pytest.mark.process
def test_a_robot_is_read_from_a_urdf_and_what_was_guessed_is_said(tmp_path):
    urdf = Path(scaffolds.__file__).parent / "skeletons" / "robot" / "example.urdf"
    made = memo("new", "robot", "lab-arm", "--folder", str(tmp_path / "arm"), "--urdf", str(urdf), "--json")
    assert made.returncode == 0, made.stderr
    told = json.loads(made.stdout)
    assert any("flange_roll" in line for line in told["notes"])
    assert any(line.startswith("guessed home: ") for line in told["notes"])
    source = (tmp_path / "arm" / "memo_lab_arm" / "__init__.py").read_text(encoding="utf-8")
    assert "MESH_FOLDER = None" in source and str(urdf.parent) not in source and "# guessed: " in source


def test_a_new_robot_can_be_mounted(site, monkeypatch):
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))
    chosen = [f"robot.backend={PLUGINS['robot']}", "robot.base_position=[0.1,0,0.2]", "robot.mount_length=0.2"]
    robot = load(None, chosen)[1].create("robot")
    assert base_pose(robot).position == (0.1, 0.0, 0.2)
    assert base_pose(load(None, chosen[:1])[1].create("robot")).position == (0.0, 0.0, 0.0)


def test_a_xacro_file_is_to_be_expanded_first_where_nothing_that_can_is_installed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    file = tmp_path / "arm.urdf.xacro"
    file.write_text("<robot name='r'/>")
    told = r"expand it first: xacro arm\.urdf\.xacro > arm\.urdf"
    with pytest.raises(InvalidArgument, match=f"{told}.*{re.escape(install('memo-core[xacro]'))}"):
        write_scaffold("robot", "lab-arm", tmp_path / "arm", file)
    assert not (tmp_path / "arm").exists()


def _xacro_package(folder: Path) -> Path:
    """A description of the six-joint arm as ROS packages are laid out: arguments, an include from a package beside."""
    macro = six_joint_arm().urdf.replace('<robot name="six">', "").replace("</robot>", "")
    macro = macro.replace('upper="3"', 'upper="${most}"')
    head = '<?xml version="1.0"?><robot name="six" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    files = {
        "arm_macros/urdf/arm.xacro": f'{head}<xacro:macro name="arm" params="most">{macro}</xacro:macro></robot>',
        "arm_description/package.xml": "<package><name>arm_description</name></package>",
        "arm_description/urdf/limits.xacro": f'{head}<xacro:property name="quarter" value="1.5"/></robot>',
        "arm_description/urdf/arm.urdf.xacro": f'{head}<xacro:arg name="kind" default="none"/>'
        '<xacro:include filename="$(find arm_macros)/urdf/arm.xacro"/><xacro:include filename="limits.xacro"/>'
        "<xacro:if value=\"${'$(arg kind)' == 'arm'}\"><xacro:arm most=\"$(arg most)\"/></xacro:if></robot>",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "arm_description" / "urdf" / "arm.urdf.xacro"


@pytest.mark.process
def test_a_xacro_file_is_expanded_with_its_arguments_and_the_packages_near_it(tmp_path):
    pytest.importorskip("xacrodoc", reason="the extra `xacro` is not installed")
    file = _xacro_package(tmp_path / "src")
    where = ["--folder", str(tmp_path / "arm"), "--urdf", str(file)]
    made = memo("new", "robot", "lab-arm", "kind:=arm", "most:=2.5", *where, "--json")
    assert made.returncode == 0, made.stderr
    written = (tmp_path / "arm" / "memo_lab_arm" / "lab-arm.urdf").read_text()
    assert 'upper="2.5"' in written and "xacro:" not in written.replace("xmlns:xacro", "")


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("kind:=arm",), "Undefined substitution argument most.*declares kind"),
        (("most:=1",), "without links"),
        (("kind:=arm", "most:=high"), "high"),
        (("most=1",), "KEY:=VALUE"),
    ],
)
def test_a_xacro_file_that_cannot_be_expanded_is_one_line(arguments, said, tmp_path):
    pytest.importorskip("xacrodoc", reason="the extra `xacro` is not installed")
    file = _xacro_package(tmp_path / "src")
    done = memo("new", "robot", "lab-arm", *arguments, "--folder", str(tmp_path / "arm"), "--urdf", str(file))
    assert done.returncode == 2 and re.search(said, done.stderr.splitlines()[-1]), done.stderr
    assert "Traceback" not in done.stderr and not (tmp_path / "arm").exists()


def test_a_package_that_a_xacro_file_needs_is_named_and_found_where_it_is_said_to_be(tmp_path):
    pytest.importorskip("xacrodoc", reason="the extra `xacro` is not installed")
    file = _xacro_package(tmp_path / "src")
    (tmp_path / "src" / "arm_macros").rename(tmp_path / "elsewhere")
    with pytest.raises(InvalidArgument, match=r"needs the ROS package 'arm_macros'.*--mesh-folder"):
        write_scaffold("robot", "lab-arm", tmp_path / "arm", RobotSource(file, {"kind": "arm", "most": "2"}))
    (tmp_path / "elsewhere").rename(tmp_path / "arm_macros_moved")
    (tmp_path / "arm_macros_moved" / "package.xml").write_text("<package><name> arm_macros </name></package>")
    source = RobotSource(file, {"kind": "arm", "most": "2"}, (tmp_path / "arm_macros_moved",))
    assert write_scaffold("robot", "lab-arm", tmp_path / "arm", source).files


@pytest.mark.process
@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--urdf", "arm.urdf", "kind:=arm"), "is no xacro"),
        (("kind:=arm",), "there is none"),
        (("--mesh-folder", "."), "there is none"),
        (("--total-mass", "5"), "--total-mass: says more about a URDF, and there is none"),
        (("--urdf", "arm.urdf", "--total-mass", "5"), "--total-mass: each link with a shape states its mass"),
        (("--urdf", "arm.urdf", "--mesh-folder", "nowhere"), "is no folder"),
    ],
)
def test_what_says_more_about_a_urdf_needs_one_that_it_fits(more, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(six_joint_arm().urdf)
    done = memo("new", "robot", "lab-arm", "--folder", "arm", *more)
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1
    assert not Path("arm").exists()


@pytest.mark.process
def test_meshes_of_another_machine_are_found_in_several_folders_and_it_is_told(tmp_path):
    for folder in ("one/visual", "two/visual"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "one/visual/a.stl").write_bytes(b"\0" * 80 + (0).to_bytes(4, "little"))
    (tmp_path / "two/visual/b.stl").write_bytes(b"\0" * 80 + (0).to_bytes(4, "little"))
    shape = '<visual><geometry><mesh filename="file:///ws/arm/visual/{}.stl"/></geometry></visual></link>'
    urdf = six_joint_arm().urdf.replace("</link>", shape.format("a"), 1)
    head, tail = urdf.split(shape.format("a"))
    urdf = head + shape.format("a") + tail.replace("</link>", shape.format("b"), 1)
    (tmp_path / "arm.urdf").write_text(urdf)
    folders = ["--mesh-folder", str(tmp_path / "one"), "--mesh-folder", str(tmp_path / "two")]
    where = ["--folder", str(tmp_path / "arm"), "--urdf", str(tmp_path / "arm.urdf")]
    told = json.loads(memo("new", "robot", "lab-arm", *where, *folders, "--json").stdout)["notes"]
    for folder in ("one", "two"):
        assert f"meshes of file:///ws/arm/visual found in {tmp_path.resolve() / folder / 'visual'}" in told
    written = (tmp_path / "arm" / "memo_lab_arm" / "lab-arm.urdf").read_text()
    assert 'filename="meshes/one/visual/a.stl"' in written and str(tmp_path) not in written
    assert (tmp_path / "arm" / "memo_lab_arm" / "meshes" / "two" / "visual" / "b.stl").is_file()


@pytest.mark.process
@pytest.mark.parametrize(
    ("text", "said"), [(None, "cannot be read"), ("<robot", "URDF"), ("<robot name='r'/>", "URDF")]
)
def test_a_urdf_that_cannot_be_read_is_one_line_and_nothing_is_written(text, said, tmp_path):
    file = tmp_path / "arm.urdf"
    if text is not None:
        file.write_text(text)
    done = memo("new", "robot", "lab-arm", "--folder", str(tmp_path / "arm"), "--urdf", str(file))
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "arm").exists()


@pytest.mark.process
def test_the_command_is_there(site):
    assert "lab command" in memo("--help", PYTHONPATH=str(site)).stdout
    assert memo("lab-command", "--help", PYTHONPATH=str(site)).returncode == 0


@pytest.mark.process
def test_a_task_can_be_run_with_a_model_a_teacher_and_skills_of_ones_own(site, tmp_path):
    chosen = [f"{kind}={json.dumps({'backend': PLUGINS[kind]})}" for kind in ("teacher", "method", "perception")]
    chosen += [f"skills={PLUGINS['skills']}", "simulator.backend=lab-simulator", f"llm.backend={PLUGINS['llm']}"]
    overrides = [part for one in chosen for part in ("--set", one)]
    where = ["--book", str(tmp_path / "book.db"), "--out", str(tmp_path), "--json"]
    done = memo("run", "--task", "open-the-fridge", *where, *overrides, PYTHONPATH=str(site))
    assert done.returncode == 1, done.stderr  # the method does nothing, and the fridge stays shut
    assert json.loads(done.stdout)["method"] == PLUGINS["method"] or "left it at that" in done.stdout


@pytest.mark.process
@pytest.mark.slow
def test_pip_installs_one_in_editable_mode_without_an_index(tmp_path):
    environment = tmp_path / "venv"
    venv.create(environment, with_pip=False, symlinks=True)
    python = environment / "bin" / "python"
    [own] = environment.glob("lib/python*/site-packages")
    parent = sysconfig.get_paths()["purelib"]
    (own / "parent.pth").write_text(f"import site; site.addsitedir({parent!r})\n")
    made = memo("new", "llm", "lab-model", "--folder", str(tmp_path / "lab-model"), "--json")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["next"][0] == f"pip install --editable {tmp_path / 'lab-model'}"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps"]
    options = ["--no-build-isolation", "--no-index", "--editable", str(tmp_path / "lab-model")]
    subprocess.run([*pip, *options], check=True, timeout=120, capture_output=True)
    checked = [str(python), "-m", "memo_core.cli.main", "plugins", "check", "llm/lab-model", "--json"]
    done = subprocess.run(checked, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and json.loads(done.stdout)["conforms"], done.stdout + done.stderr


@pytest.mark.parametrize("page", SHOWN)
def test_the_page_of_a_kind_shows_the_plugin_as_it_is_written(page):
    kind, name = SHOWN[page]
    [source] = [text for file, text in rendered(kind, name).items() if file == f"memo_{name.replace('-', '_')}.py"]
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    assert source in re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert f"memo new {kind} {name}" in text


@pytest.mark.process
@pytest.mark.parametrize(
    ("kind", "name", "said"),
    [
        ("llm", "offline", "memo-offline has a llm 'offline' already; expected another name\n"),
        ("robot", "panda", "memo-franka has a robot 'panda' already; expected another name\n"),
        ("teacher", "nobody", "already"),  # a former name
        ("command", "run", "a command 'run' already"),
        ("skills", "import", "a word of Python"),
        ("gripper", "MyGripper", "such as my-gripper"),
    ],
)
def test_a_name_that_could_not_be_chosen_is_refused(kind, name, said, tmp_path):
    done = memo("new", kind, name, "--folder", str(tmp_path / "x"))
    assert done.returncode == 2 and said in done.stderr
    assert not (tmp_path / "x").exists()


def test_a_folder_that_cannot_be_written_is_an_error_that_names_it(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidArgument, match="file"):
        write_scaffold("llm", "mine", tmp_path / "file" / "below")


@pytest.mark.process
def test_what_is_written_is_formatted_and_has_no_unused_names(site):
    """As ``ruff`` sees it with the width of this repository."""
    for arguments in (["format", "--check"], ["check", "--select", "E,F,B,UP,SIM"]):
        # A robot is written from a URDF, whose names are as long as they are.
        files = [str(file) for file in site.glob("*.py")]
        command = [sys.executable, "-m", "ruff", *arguments, "--isolated", "--line-length", "120", "--no-cache", *files]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stdout


def test_modules_of_conformance_suites_are_those_that_the_tests_import():
    for kind, scaffold in SCAFFOLDS.items():
        if scaffold.backend_kind:
            importlib.import_module(f"memo_core.testing.{scaffold.backend_kind}")
        assert scaffold.about.startswith("Write a plugin"), kind
