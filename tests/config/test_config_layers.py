"""What an experiment means: which layer wins, where each value is from, what is taken when nothing is said."""

from __future__ import annotations

import json
import re
from pathlib import Path

import attrs
import jsonschema
import pytest
import yaml

from memo_core.cli.main import main
from memo_core.config import ConfigErrors, load_experiment
from memo_core.config.layers import FromOption
from memo_core.config.schema import experiment_schema
from memo_core.errors import BackendUnavailable
from memo_core.interfaces.backend import Backend, Needs
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import NoDefaultBackend, Registry
from memo_core.policy.consolidation import ClusteringSettings
from memo_core.testing.fake_entry_point import FakeEntryPoint
from tests.support.config_backends import Budget, Camera, load, registry


def where(experiment) -> dict[str, str]:
    return {value.path: str(value.origin).split("/")[-1] for value in experiment.values}


def test_later_layers_win_and_every_value_says_where_it_is_from(tmp_path):
    (tmp_path / "lab.yaml").write_text(
        "seed: 1\nbudget: {seconds: 1}\nperception:\n  width: 10\n  noise: {position: 0.1}\n"
    )
    (tmp_path / "mine.yaml").write_text("perception: {height: 20, labels: [a, b]}\n")
    text = "extends: [lab.yaml, mine.yaml]\nseed: 2\nperception:\n  labels: [c]\n"
    experiment = load(text, "perception.height=30", folder=tmp_path)
    camera = experiment.choice("perception").settings
    assert (camera.width, camera.height, camera.labels, camera.noise.position) == (10, 30, ["c"], 0.1)
    assert experiment.seed == 2
    origins = where(experiment)
    assert origins["seed"] == "experiment.yaml:2"
    assert origins["budget.seconds"] == "lab.yaml:2"
    assert origins["perception.width"] == "lab.yaml:4"
    assert origins["perception.noise.position"] == "lab.yaml:5"
    assert origins["perception.noise.axes"] == "default"
    assert origins["perception.height"] == "--set"
    assert origins["perception.labels"] == "experiment.yaml:4"
    assert origins["perception.mode"] == "default"


def test_a_layer_that_names_another_backend_replaces_the_section(tmp_path):
    (tmp_path / "base.yaml").write_text("llm: {backend: hosted, model: m, temperature: 1}\n")
    assert load("extends: base.yaml\nllm: {temperature: 2}", folder=tmp_path).choice("llm").settings.temperature == 2
    assert load("extends: base.yaml\nllm: local", folder=tmp_path).choice("llm").backend.name == "local"
    assert load("extends: base.yaml", "llm.backend=local", folder=tmp_path).choice("llm").backend.name == "local"


def test_one_word_is_short_for_a_backend(tmp_path):
    assert load("llm: local", folder=tmp_path).choice("llm").backend.name == "local"
    assert load(None, "llm=hosted", "llm.model=m").choice("llm").settings.model == "m"


@pytest.mark.parametrize(
    "overrides",
    [
        ("llm.temperature=2", FromOption('llm="hosted"', "--llm"), "llm.model=m"),
        ("llm.model=m", "llm.temperature=2", "llm=hosted"),
        ("llm.temperature=2", "llm.model=m", "llm.backend=hosted"),
        ("llm={model: m, temperature: 2}", "llm=hosted"),
        ("llm.temperature=2", "llm={backend: hosted, model: m}"),
    ],
)
def test_an_option_that_names_a_backend_discards_no_other_option(overrides):
    experiment = load(None, *overrides)
    assert experiment.choice("llm").backend.name == "hosted"
    assert attrs.asdict(experiment.choice("llm").settings) == {"model": "m", "temperature": 2.0, "token": ""}


def test_the_last_option_that_names_a_backend_is_taken():
    for overrides in (("llm.backend=hosted", "llm=local"), ("llm=hosted", "llm={backend: local}")):
        assert load(None, *overrides).choice("llm").backend.name == "local"


def test_an_option_that_the_backend_chosen_afterwards_does_not_know_is_an_error():
    for first in ("llm.model=m", "llm={backend: hosted, model: m}"):
        with pytest.raises(ConfigErrors, match=r"--set: llm\.model: unknown key"):
            load(None, first, "llm=local")


def test_a_key_of_a_value_without_keys_is_an_error_whatever_the_order():
    for overrides in (
        ("clustering.llm.model=a", "clustering.llm=offline"),
        ("clustering.llm=offline", "clustering.llm.model=a"),
    ):
        with pytest.raises(ConfigErrors) as caught:
            load_experiment(Registry(), None, overrides, {"clustering": ClusteringSettings})
        assert str(caught.value) == (
            "--set: clustering.llm.model: clustering.llm is set to 'offline', which has no keys; "
            "a backend is named beside its keys by clustering.llm.backend=offline"
        )


@pytest.mark.parametrize("order", [1, -1])
def test_a_driver_may_be_named_in_short_beside_options_for_its_keys(order):
    given = ("robot.driver=franka", "robot.driver.address=a", "robot.gripper_driver=wsg", "robot.gripper_driver.port=7")
    values = load_experiment(Registry(), None, given[::order]).public()
    assert (values["robot.driver.backend"], values["robot.driver.address"]) == ("franka", "a")
    assert (values["robot.gripper_driver.backend"], values["robot.gripper_driver.port"]) == ("wsg", 7)


@pytest.mark.parametrize(
    ("robot", "option", "path", "value"),
    [
        ("{driver: franka, address: 10.0.0.7}", "robot.driver.mode=impedance", "robot.driver.mode", "impedance"),
        ("{driver: franka, address: 10.0.0.7}", "robot.driver.address=1", "robot.driver.address", "1"),
        ("{driver: {backend: franka}}", "robot.driver.mode=impedance", "robot.driver.mode", "impedance"),
        ("{gripper_driver: wsg}", "robot.gripper_driver.port=7", "robot.gripper_driver.port", 7),
    ],
)
def test_a_key_of_a_driver_is_set_however_a_file_names_the_driver(tmp_path, robot, option, path, value):
    file = tmp_path / "arm.yaml"
    file.write_text(f"robot: {robot}")
    experiment = load_experiment(Registry(), file, [option])
    assert experiment.public()[path] == value and where(experiment)[path] == "--set"
    key = "gripper_driver" if "gripper" in path else "driver"
    assert experiment.choice(f"robot_{key}" if key == "driver" else key).backend.name in robot


def test_an_option_for_one_value_outlives_a_later_one_for_its_section():
    from memo_core.runs.sections import SECTIONS

    later = load_experiment(Registry(), None, ("retrieval.cut=0.9", "retrieval=paper"), SECTIONS)
    sooner = load_experiment(Registry(), None, ("retrieval=paper", "retrieval.cut=0.9"), SECTIONS)
    assert later.section("retrieval") == sooner.section("retrieval")
    assert later.section("retrieval").cut == 0.9


@pytest.mark.parametrize("words", ["{}", "no: {}", "", "12", "[unclosed", "a: b: c", "true", "1e-3", "{name}: slow"])
def test_what_an_option_gives_a_text_is_taken_literally(words):
    experiment = load(None, "llm=hosted", f"llm.model={words}", f"perception.note={words}")
    assert experiment.choice("llm").settings.model == words
    assert experiment.choice("perception").settings.note == (words or None)
    assert experiment.public()["llm.model"] == words, "a resumed run reads what is recorded"


def test_an_option_gives_a_text_quotes_and_null_as_yaml_does():
    assert load(None, 'perception.note="{}: 1"').choice("perception").settings.note == "{}: 1"
    assert load(None, "perception.note=null").choice("perception").settings.note is None
    with pytest.raises(ConfigErrors, match=r"llm\.model: missing value; expected text"):
        load(None, "llm=hosted", "llm.model=null")


@pytest.mark.parametrize("option", ["perception.labels=[a, b", "perception.width=[1", "perception.noise={position: 1"])
def test_an_option_that_is_not_yaml_is_a_mistake_where_no_text_is_wanted(option):
    with pytest.raises(ConfigErrors, match="not YAML"):
        load(None, option)


def test_without_a_file_the_plugins_defaults_are_taken():
    experiment = load()
    assert experiment.choice("llm").backend.name == "local"
    assert experiment.choice("perception").settings == Camera()
    assert experiment.section("budget") == Budget()
    assert (experiment.task, experiment.seed) == (None, 0)
    with pytest.raises(NoDefaultBackend, match="simulator"):
        experiment.choice("simulator")


def test_interpolation_and_yaml_numbers(tmp_path):
    text = "seed: 7\nperception: {width: '${seed}', noise: {position: 1e-3}}\nbudget: {seconds: 3}"
    experiment = load(text, folder=tmp_path)
    assert experiment.choice("perception").settings.width == 7
    assert experiment.choice("perception").settings.noise.position == 0.001
    assert type(experiment.section("budget").seconds) is float


def test_words_that_yaml_1_1_would_turn_into_something_else_stay_words(tmp_path):
    for word in ("no", "on", "1:30", "010", "2024-01-01"):
        assert load(f"perception: {{note: {word}}}", folder=tmp_path).choice("perception").settings.note == word


def test_merge_keys_and_anchors_work(tmp_path):
    text = "perception: {noise: &n {position: 0.5}}\nllm: {<<: *n}"
    assert load(text, folder=tmp_path).choice("llm").settings.position == 0.5


def test_a_backend_whose_module_is_missing_says_what_brings_it():
    @hookimpl
    def memo_vector_stores():
        needs = Needs(modules={"no_such_module_x": "x-dist"})
        return [Backend("vectorstore", "x", "for tests", lambda settings: settings, needs=needs)]

    plugin = FakeEntryPoint("p", "d", memo_vector_stores=memo_vector_stores)
    with pytest.raises(BackendUnavailable, match="install x-dist"):
        load_experiment(Registry([plugin])).create("vectorstore")


def test_what_show_prints_is_an_experiment_again(tmp_path):
    text = "seed: 3\nllm: {backend: hosted, model: m}\nperception: {noise: {axes: [1, 2]}, mode: depth}"
    first = load(text, folder=tmp_path)
    lines = [f"{path}={json.dumps(value)}" for path, value in first.public().items() if value is not None]
    second = load(None, *lines)
    assert second.public() == first.public()
    assert attrs.asdict(second.choice("perception").settings) == attrs.asdict(first.choice("perception").settings)


@pytest.mark.parametrize(
    ("text", "valid"),
    [
        ("seed: 3\nllm: local\nperception: {width: 3, noise: {axes: [1, 2]}}", True),
        ("llm: {backend: hosted, model: m}", True),
        ("seed: 3\nperception: {width: '${seed}'}", True),
        ("perception: {widht: 3}", False),
        ("perception: {width: wide}", False),
        ("perception: {noise: {axes: [1]}}", False),
        ("llm: {backend: hosted}", False),
        ("llm: hostd", False),
        ("budgte: {}", False),
    ],
)
def test_the_schema_and_the_checks_agree(tmp_path, text, valid):
    schema = experiment_schema(registry(), {"budget": Budget})
    jsonschema.Draft202012Validator.check_schema(schema)
    assert jsonschema.Draft202012Validator(schema).is_valid(yaml.safe_load(text)) is valid
    try:
        load(text, folder=tmp_path)
    except ConfigErrors:
        assert not valid
    else:
        assert valid


def run(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def test_show_and_schema_work_with_the_installed_plugins(tmp_path, capsys):
    file = tmp_path / "mine.yaml"
    file.write_text("retrieval: {cut: 0.9}\n")
    assert run("config", "show", str(file), "--set", "seed=5", "--json") == 0
    values = {value["path"]: value for value in json.loads(capsys.readouterr().out)["values"]}
    assert (values["seed"]["value"], values["seed"]["file"]) == (5, "--set")
    assert (values["retrieval.cut"]["value"], values["retrieval.cut"]["line"]) == (0.9, 1)
    assert values["retrieval.corrections"]["file"] == "default"
    assert run("config", "schema") == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert jsonschema.Draft202012Validator(schema).is_valid({"retrieval": {"cut": 0.9}})
    assert not jsonschema.Draft202012Validator(schema).is_valid({"retrieval": {"cutt": 0.9}})


EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.yaml"))


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_every_example_is_in_order_and_its_task_exists(file, capsys):
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.runs.factories import task_of

    assert run("config", "check", str(file)) == 0
    experiment = load_experiment(Registry(), file, (), ALL_SECTIONS)
    if experiment.task is None:
        [hours] = [value for value in experiment.values if value.path == "evaluation.hours"]
        evaluated = str(hours.origin) != "default" or "\nevaluation:" in file.read_text(encoding="utf-8")
        assert evaluated or "--task" in file.read_text(encoding="utf-8"), "only an evaluation has tasks of its own"
        return
    assert task_of(experiment, experiment.task).name == experiment.task


@pytest.mark.parametrize("page", ["README.md", "docs/configuration.md"])
def test_the_experiment_on_a_page_is_in_order(page, tmp_path):
    text = (Path(__file__).parents[2] / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert blocks
    (tmp_path / "lab.yaml").write_text("seed: 1\n")
    for number, block in enumerate(blocks):
        file = tmp_path / f"{number}.yaml"
        file.write_text(block)
        assert run("config", "check", str(file)) == 0


def test_every_kind_that_an_experiment_needs_has_a_declared_default():
    """Being the only one installed is not enough: the next plugin of the kind would unsettle every experiment."""
    from memo_core.config.experiment import SINGLE_KINDS

    registry = Registry()
    for kind in SINGLE_KINDS:
        assert [backend.default for backend in registry.backends(kind)].count(True) == 1, kind
