"""A prompt file fills in what its phase declares, and can do nothing else: it may come from somebody else."""

from __future__ import annotations

import math
import resource
from pathlib import Path

import pytest

from memo_core.cli.main import main
from memo_core.llm import prompt_process
from memo_core.llm.prompt_files import BUILT_IN, SAMPLES, BadPrompt, PromptText, _fault_of, built_in
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.pose import Pose

PLAN = "{{ task }} {{ scene }} "
HOSTILE = {
    "a global of Jinja": "{{ cycler.__init__.__globals__.os.popen('touch TRACE').read() }}",
    "another global": "{{ lipsum.__globals__['os'].system('touch TRACE') }}",
    "the class of a text": "{{ task.__class__.__mro__[1].__subclasses__() }}",
    "the same through a filter": "{{ task|attr('__class__') }}",
    "the same through map": "{{ [task]|map(attribute='__class__')|first }}",
    "a format text": "{{ '{0.__class__.__init__}'.format(task) }}",
    "the context itself": "{{ self.__init__.__globals__ }}",
    "the environment": "{{ self._TemplateReference__context.environment }}",
    "a method of the robot": "{{ robot.evil() }}",
    "a range": "{{ range(10) }}",
    "a file": "{% include '/etc/passwd' %}",
    "a changed list": "{{ done.append('x') }}",
    "a huge power": "{{ 9**9**9 }}",
    "a huge text": "{{ 'x' * 10000000000 }}",
}


DOUBLED = "{% set a = task %}" + "{% set a = a ~ a %}" * 40 + "{{ a }}"
LONG = "{{ '" + "x" * 100_000 + "'.replace('x', '" + "y" * 100_000 + "') }}"
NESTED = "".join(f"{{% for v{n} in scene %}}" for n in range(15)) + "x" + "{% endfor %}" * 15
SILENT = NESTED.replace("%}x{%", "%}{% set y = 1 %}{%")
FORKED = "{% macro f(n) %}{% if n %}{{ f(n - 1) }}{{ f(n - 1) }}{% endif %}{% endmacro %}{{ f(60) }}"
BOMBS = {
    "a text doubled 40 times": DOUBLED,
    "a list doubled 40 times": "{% set a = [1] %}" + "{% set a = a + a %}" * 40 + "{{ a|length }}",
    "a text centred by a filter": "{{ task|center(10000000000) }}",
    "a text centred by a method": "{{ task.center(10000000000) }}",
    "a text filled by a method": "{{ task.zfill(10000000000) }}",
    "tabs as wide as memory": "{{ 'a\\tb'.expandtabs(10000000000) }}",
    "a wide number": "{{ '%10000000000d'|format(1) }}",
    "a wide number by an operator": "{{ '%10000000000d' % 1 }}",
    "a wide number by a method": "{{ '{:>10000000000}'.format(1) }}",
    "a deep indentation": "{{ task|indent(10000000000, true) }}",
    "every letter replaced by many": LONG,
    "many slices": "{{ done|slice(1000000000)|list|length }}",
    "batches filled up": "{{ done|batch(1000000000, 'x')|list|length }}",
    "nested loops that print": NESTED,
    "nested loops that print nothing": SILENT,
    "a macro that calls itself": "{% macro f() %}{{ f() }}{% endmacro %}{{ f() }}",
    "a macro that calls itself twice": FORKED,
    "a loop that calls itself": "{% for x in done recursive %}{{ loop(done) }}{% endfor %}",
    "deep brackets": "{{ " + "(" * 3000 + "1" + ")" * 3000 + " }}",
    "deep blocks": "{% if task %}" * 2000 + "{% endif %}" * 2000,
    "a template that is imported": "{% import 'x' as y %}",
    "a template that is extended": "{% extends task %}",
    "an included one that may be missing": "{% include ['a', '/etc/passwd'] ignore missing %}{{ nobody }}",
    "what a caller would be": "{{ caller() }}",
    "the class by groups": "{{ (done|groupby('__class__')|first).grouper }}",
    "the class by order": "{{ done|sort(attribute='__class__.__mro__') }}",
    "the code of a macro": "{% macro f() %}{% endmacro %}{{ f._func.__globals__ }}",
    "the class by a subscript": "{{ task['__class__'] }}",
    "a format by map": "{{ ['{0.__class__}']|map('format', task)|list }}{{ task.__class__ }}",
    "the size of a huge integer": "{{ ('9' * 1)|int ** 2 }}",
}


@pytest.fixture
def hurried(monkeypatch):
    """The process that reads prompt files, with a second or two for each question."""
    process = prompt_process.PromptProcess(seconds=0)
    monkeypatch.setattr(prompt_process, "PROCESS", process)
    _fault_of.cache_clear()
    yield process
    process.close()


@pytest.mark.parametrize("kind", BOMBS)
def test_a_prompt_file_that_would_take_all_time_or_memory_is_refused_in_one_line(kind, hurried):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BadPrompt) as refused:
        PromptText("plan", PLAN + BOMBS[kind], "1", "plan.md.j2").check()
    assert str(refused.value).startswith("plan.md.j2") and len(str(refused.value).split("; placeholders")[0]) < 700
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10, "it took this process's memory"
    PromptText("plan", PLAN, "1", "plan.md.j2").check()


def test_a_file_that_is_cheap_with_samples_is_bounded_in_a_run_too(hurried):
    text = PromptText("plan", PLAN + "{% if task != 'open the jar' %}" + SILENT + "{% endif %}", "1", "plan.md.j2")
    text.check()
    with pytest.raises(BadPrompt, match="takes more than 0 s of the processor"):
        text.render({**SAMPLES, "task": "stack the cubes"})


def test_a_process_that_was_killed_between_two_files_is_started_again(hurried):
    text = PromptText("plan", PLAN, "1", "plan.md.j2")
    text.check()
    hurried._process.kill()
    hurried._process.wait()
    assert text.render(SAMPLES)


def test_the_process_sees_nothing_of_the_environment(hurried, monkeypatch):
    monkeypatch.setenv("SOME_SECRET", "abc123")
    PromptText("plan", PLAN, "1", "plan.md.j2").check()
    environ = Path(f"/proc/{hurried._process.pid}/environ")
    assert not environ.exists() or b"abc123" not in environ.read_bytes()


def test_a_file_of_ones_own_sees_the_same_values_as_a_built_in_one():
    pose = Pose((0.0, 0.1, 0.2))
    robot = RobotDescription(
        "arm", "<robot/>", (), GripperDescription(), "tool", tool_offset=pose, home=(0.1, math.inf)
    )
    given = {**SAMPLES, "robot": robot, "done": ("ä\ud800", "b"), "corrected": [{"subtask": "OPEN(jar)", "notes": ()}]}
    shown = "{{ robot.gripper.hand_size[1] }} {{ robot.name }} {{ robot.home }} {{ done }} {{ corrected[0].subtask }}"
    shown += " {{ robot.joint_names|length }} {{ corrected[0].notes or 'none' }} {{ notes[0].text }}"
    shown += " {{ robot.tool_offset.position[1] }}"
    own, ours = (PromptText("plan", PLAN + shown, "1", source).render(given) for source in ("plan.md.j2", BUILT_IN))
    assert own.translate(str.maketrans("[]", "()")) == ours, "a sequence is a list there"


class Armed(RobotDescription):
    def evil(self) -> str:
        raise AssertionError("a prompt called a method of the robot")


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_prompt_file_cannot_reach_beyond_what_its_phase_declares(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = PromptText("plan", PLAN + HOSTILE[kind], "1", "plan.md.j2")
    robot = Armed("arm", "", (), GripperDescription(), "tool")
    with pytest.raises(BadPrompt):
        text.check()
    with pytest.raises(BadPrompt):
        text.render({**SAMPLES, "robot": robot})
    assert not list(tmp_path.iterdir())


def test_only_the_variables_of_the_phase_are_there():
    text = PromptText("plan", "{{ words }}", "1", "plan.md.j2")
    with pytest.raises(BadPrompt, match="words"):
        text.render({**SAMPLES, "words": "of another phase"})


def test_config_check_refuses_a_prompt_that_would_run_code_and_names_the_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.md.j2").write_text("{{ task }}\n{{ scene }}\n" + HOSTILE["a global of Jinja"])
    (tmp_path / "a.yaml").write_text("prompts: {plan: plan.md.j2}\n")
    with pytest.raises(SystemExit) as ended:
        main(["config", "check", "a.yaml"])
    said = capsys.readouterr().err
    assert ended.value.code == 2 and "plan.md.j2:3: unknown placeholder 'cycler'" in said
    assert not (tmp_path / "TRACE").exists()


def test_what_prompts_need_still_works():
    text = "{{ task.upper() }} {{ '%.2f'|format(robot.reach) }} {% for d in done %}{{ loop.index }} {{ d }}{% endfor %}"
    text += " {{ loop_free if false else 2 * 3 }} {{ done|join(', ') }} {{ scene|unfenced|length }}"
    assert PromptText("plan", text, "1", "x").render(SAMPLES).startswith("OPEN THE JAR 0.85 1 OPEN(jar) 6 OPEN(jar)")
    for name in ("system", "plan", "code", "feedback", "template", "cluster"):
        built_in(name).check()
