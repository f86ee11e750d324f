"""A prompt file fills in what its phase declares, and can do nothing else: it may come from somebody else."""

from __future__ import annotations

import pytest

from memo_core.cli.main import main
from memo_core.llm.prompt_files import SAMPLES, BadPrompt, PromptText, built_in
from memo_core.robot.description import GripperDescription, RobotDescription

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
    "a template that is imported": "{% import 'x' as y %}",
    "a template that is extended": "{% extends task %}",
    "an included one that may be missing": "{% include ['a', '/etc/passwd'] ignore missing %}{{ nobody }}",
    "what a caller would be": "{{ caller() }}",
    "the class by groups": "{{ (done|groupby('__class__')|first).grouper }}",
    "the class by order": "{{ done|sort(attribute='__class__.__mro__') }}",
    "the code of a macro": "{% macro f() %}{% endmacro %}{{ f._func.__globals__ }}",
    "the class by a subscript": "{{ task['__class__'] }}",
    "a format by map": "{{ ['{0.__class__}']|map('format', task)|list }}{{ task.__class__ }}",
}


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
    assert PromptText("plan", text, "1", "x").render(SAMPLES)[1].startswith("OPEN THE JAR 0.85 1 OPEN(jar) 6 OPEN(jar)")
    for name in ("system", "plan", "code", "feedback", "template", "cluster"):
        built_in(name).check()
