"""Imports run downward only and never in circles; plugins do not import each other; the core imports no plugin."""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from types import FunctionType

import pytest

import memo_core
from memo_core.interfaces.backend import KINDS
from memo_core.plugins.registry import Registry

ROOT = Path(__file__).parents[1]
CORE = sorted((ROOT / "memo_core").rglob("*.py"))
Levels = tuple[tuple[str, ...], ...]
PLUGINS = {path.parent.name: path.parent for path in sorted((ROOT / "plugins").glob("*/memo_*/__init__.py"))}

# Packages and modules directly below memo_core; those in one line do not import each other either.
LEVELS = (
    ("errors", "events", "lazy_exports", "moved_modules"),
    ("text", "process"),
    ("scene",),
    ("robot",),
    ("skills",),
    ("interfaces",),
    ("plugins",),
    ("config",),
    ("skillbook", "sandbox", "arm", "runlog"),
    ("llm",),
    ("policy",),
    ("environment",),
    ("teachers",),
    ("runs",),
    ("maintenance", "study"),
    ("evaluation",),
    ("report",),
    ("demo",),
    ("api", "plugin"),
    ("testing",),
    ("cli",),
)
# The same within the skillbook.
SKILLBOOK_LEVELS = (
    ("model",),
    ("store",),
    ("vectors",),
    ("retrieval",),
    ("writing",),
    ("forgetting",),
    ("sharing",),
    ("consolidation",),
    ("book",),
    ("consolidating", "exchange", "functions", "history", "raw_log", "stats", "track_record"),
    ("explaining",),
)
PACKAGES = sorted(
    ".".join(path.parent.relative_to(ROOT).parts)
    for path in CORE
    if path.name == "__init__.py" and "lazy_exports(" in path.read_text(encoding="utf-8")
)
BUILT_IN = ROOT / "memo_core/plugins/builtin.py"  # a plugin that is part of the core; loaded by its entry point
# Distributions whose files do not say, or say elsewhere, which package they bring.
WHEELS_WITHOUT_A_LIST = {
    "pinocchio": ["pin"],
    "coal": ["coal"],
    "pydantic_monty": ["pydantic-monty"],
    "franky": ["franky-control"],  # an extra, which need not be installed here
}
VENDORS = {
    "mujoco",
    "pybullet",
    "litellm",
    "faiss",
    "chromadb",
    "torch",
    "sentence_transformers",
    "onnxruntime",
    "openai",
}


def imports(source: str, package: str) -> Iterator[str]:
    """Every module that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def wrong_imports(part: str, source: str, package: str, base: str = "memo_core", levels: Levels = LEVELS) -> set[str]:
    """The parts of ``base`` that a file of one of its parts imports, though they are not below it."""
    level = {name: place for place, names in enumerate(levels) for name in names}
    inside = [module.removeprefix(f"{base}.") for module in imports(source, package) if module.startswith(f"{base}.")]
    targets = {module.split(".")[0] for module in inside} & set(level) - {part}
    return {target for target in targets if level[target] >= level[part]}


def wrong_in(base: str, levels: Levels) -> dict[str, set[str]]:
    """The wrong imports of every file below a package."""
    folder, wrong = ROOT / base.replace(".", "/"), {}
    for path in sorted(folder.rglob("*.py")):
        part = path.relative_to(folder).parts[0].removesuffix(".py")
        if part == "__init__" or path == BUILT_IN:
            continue
        found = wrong_imports(part, path.read_text(encoding="utf-8"), package_of(path), base, levels)
        if found:
            wrong[str(path.relative_to(ROOT))] = found
    return wrong


def package_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).parent.parts)


@pytest.mark.parametrize(("base", "levels"), [("memo_core", LEVELS), ("memo_core.skillbook", SKILLBOOK_LEVELS)])
def test_imports_of_the_core_point_downward(base, levels):
    folder = ROOT / base.replace(".", "/")
    parts = {path.relative_to(folder).parts[0].removesuffix(".py") for path in folder.rglob("*.py")}
    assert parts - {"__init__"} == {name for names in levels for name in names}
    assert not wrong_in(base, levels)


def test_nothing_imports_the_built_in_plugin():
    for path in CORE:
        modules = set(imports(path.read_text(encoding="utf-8"), package_of(path)))
        assert "memo_core.plugins.builtin" not in modules, path


@pytest.mark.parametrize(
    ("part", "source"),
    [
        ("scene", "from memo_core.policy import loop"),
        ("arm", "import memo_core.skillbook.book"),
        ("policy", "def later():\n    from memo_core import runs"),
        ("skills", "from ..cli import app"),
    ],
)
def test_an_import_that_points_upward_or_across_is_seen(part, source):
    assert wrong_imports(part, source, f"memo_core.{part}")


def circles(files: dict[str, str]) -> set[frozenset[str]]:
    """Groups of modules (name -> source) that import each other, imports inside functions and for types included."""
    graph = {
        name: set(imports(source, name.rpartition(".")[0])) & set(files) - {name} for name, source in files.items()
    }

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            for target in graph[waiting.pop()] - seen:
                seen.add(target)
                waiting.append(target)
        return seen

    reach = {name: reached(name) for name in graph}
    return {frozenset(o for o in reach[name] if name in reach[o]) for name in graph if name in reach[name]}


def test_no_files_import_each_other_in_a_circle():
    bases = [ROOT / "memo_core", ROOT / "benchmarks" / "memo_benchmarks", *PLUGINS.values()]
    paths = [path for base in bases for path in base.rglob("*.py") if path.name != "__init__.py"]
    roots = {path: next(base.parent for base in bases if path.is_relative_to(base)) for path in paths}
    files = {
        ".".join(path.relative_to(roots[path]).with_suffix("").parts): path.read_text(encoding="utf-8")
        for path in paths
    }
    assert len(files) > 200
    assert not circles(files)


def test_a_circle_is_seen_wherever_in_a_file_the_import_is():
    one = (
        "from __future__ import annotations\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from p import b\n"
    )
    files = {
        "p.a": one,
        "p.b": "def later():\n    from p.c import x\n",
        "p.c": "from .a import y\n",
        "p.d": "import p.a",
    }
    assert circles(files) == {frozenset({"p.a", "p.b", "p.c"})}


def test_the_core_imports_no_plugin_and_no_vendor():
    for path in CORE:
        top = {module.split(".")[0] for module in imports(path.read_text(encoding="utf-8"), package_of(path))}
        assert not top & (set(PLUGINS) | VENDORS), path


def test_plugins_never_import_each_other():
    for name, folder in PLUGINS.items():
        for path in folder.rglob("*.py"):
            top = {module.split(".")[0] for module in imports(path.read_text(encoding="utf-8"), name)}
            assert not top & (set(PLUGINS) - {name}), path


def test_the_core_names_no_backend():
    registry = Registry()
    foreign = {
        backend.name
        for kind in KINDS
        for backend in registry.backends(kind)
        if registry.plugin_of(backend).distribution != "memo-core"
    }
    assert foreign
    for path in CORE:
        constants = {
            n.value for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Constant)
        }
        assert not constants & foreign, path


@pytest.mark.parametrize("project", [ROOT, *(path.parent for path in PLUGINS.values())], ids=lambda path: path.name)
def test_every_distribution_declares_what_it_imports(project):
    """Somebody else's requirement may go, or be of another version, and then only an import error tells."""
    about = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = about.get("optional-dependencies", {}).values()
    stated = {plain_name(one) for group in (about["dependencies"], *extras) for one in group}
    package = next(project.glob("memo_*"))
    # Robot code, run in the sandbox, and programs for another Python: what they import is there by other rules.
    files = [path for path in package.rglob("*.py") if not {"solutions", "far_side"} & set(path.parts)]
    used = {module.split(".")[0] for path in files for module in imports(path.read_text(encoding="utf-8"), "memo")}
    distributions = installed_modules() | WHEELS_WITHOUT_A_LIST
    for module in used - set(sys.stdlib_module_names) - {"memo", package.name, "__future__"}:
        providers = {plain_name(one) for one in distributions.get(module, [module])}
        assert providers & stated, f"{package.name} imports {module}, of {sorted(providers)}"


def test_all_distributions_have_one_version_types_and_ask_for_a_bounded_core():
    projects = [ROOT, *(path.parent for path in [ROOT / "benchmarks" / "memo_benchmarks", *PLUGINS.values()])]
    about = [tomllib.loads((one / "pyproject.toml").read_text(encoding="utf-8"))["project"] for one in projects]
    assert {one["version"] for one in about} == {memo_core.__version__}
    for project, one in zip(projects, about, strict=True):
        assert (next(project.glob("memo_*")) / "py.typed").is_file(), project
        asked = [each for each in one["dependencies"] if plain_name(each) == "memo-core"]
        assert one["name"] == "memo-core" or re.search(r">=\d+\.\d+,<\d+\.\d+$", *asked), project


@functools.cache
def installed_modules() -> dict[str, list[str]]:
    """Top-level module -> the distributions that provide it. Asking costs most of a second."""
    return dict(metadata.packages_distributions())


def plain_name(requirement: str) -> str:
    """The distribution's name as the package index spells it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=!~; ]", requirement)[0]).lower()


@pytest.mark.process
def test_nothing_in_the_repository_holds_a_machine_path_or_an_index():
    import subprocess

    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("not a git checkout")
    forbidden = ("/" + "root/", "/" + "work/", "--index" + "-url", "--extra-index" + "-url")
    elsewhere = re.compile(r"--find" + r"-links[ =]['\"]?(?:/|[a-z]+:)")  # not the folder of a release
    for name in filter(None, tracked.stdout.split("\0")):
        path = ROOT / name
        if path.suffix in {".png", ".mp4", ".onnx", ".gif", ".jpg"} or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        assert not [word for word in forbidden if word in text] and not elsewhere.search(text), name


def private_imports(source: str) -> set[str]:
    """The names that a file imports from the core and that are not public: public are those of ``memo_core``,
    ``memo_core.plugin``, a module of ``memo_core.testing`` and the ``__init__`` of a package."""
    private = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            private |= {alias.name for alias in node.names if alias.name.startswith("memo_core.")}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "memo_core":
            module = str(node.module)
            if module.startswith("memo_core.testing"):
                continue
            public = set(getattr(importlib.import_module(module), "__all__", ()))
            package = module == "memo_core.plugin" or (ROOT / module.replace(".", "/") / "__init__.py").is_file()
            private |= {f"{module}.{alias.name}" for alias in node.names if not package or alias.name not in public}
    return private


def test_shipped_plugins_and_examples_import_public_names():
    folders = [*PLUGINS.values(), ROOT / "examples"]
    files = [path for folder in folders for path in folder.rglob("*.py") if "solutions" not in path.parts]
    assert len(files) > 100
    found = {str(path.relative_to(ROOT)): private_imports(path.read_text(encoding="utf-8")) for path in files}
    assert not {path: names for path, names in found.items() if names}


def test_the_documentation_imports_public_names():
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    found = {}
    for page in pages:
        for code in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            if names := private_imports(code):
                found[str(page.relative_to(ROOT))] = names
    assert not found


def test_a_private_import_is_seen():
    code = (
        "import memo_core.skillbook.book\nfrom memo_core.scene.pose import Pose\nfrom memo_core.scene import Pose, pose"
    )
    assert private_imports(code) == {"memo_core.skillbook.book", "memo_core.scene.pose.Pose", "memo_core.scene.pose"}


@pytest.mark.parametrize("module", ["memo_core", "memo_core.plugin", *PACKAGES])
def test_every_export_is_there(module):
    package = importlib.import_module(module)
    for name in package.__all__:
        assert getattr(package, name) is not None


def exported_functions() -> list[FunctionType]:
    found = set()
    for module in ("memo_core", "memo_core.plugin", *PACKAGES):
        package = importlib.import_module(module)
        values = (getattr(package, name) for name in package.__all__)
        found |= {value for value in values if isinstance(value, FunctionType)}
    return sorted(found, key=lambda function: (function.__module__, function.__name__))


@pytest.mark.parametrize("function", exported_functions(), ids=lambda function: function.__qualname__)
def test_exported_functions_document_their_arguments(function):
    documented = (function.__doc__ or "").partition("Args:\n")[2]
    missing = [name for name in inspect.signature(function).parameters if not re.search(rf"\b{name}: ", documented)]
    assert not missing, f"{function.__module__}.{function.__name__} documents no {', '.join(missing)}"
