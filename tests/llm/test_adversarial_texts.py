"""Texts of people and models are read in time that grows no faster than their length, whatever they hold.

Each reader runs in a process with a limit of processor time. It is generous for linear work, also on a loaded machine,
and far too short for work that takes the square of a text's length.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.process

PROCESSOR_S = 60
READ = r"""
import resource, sys
resource.setrlimit(resource.RLIMIT_CPU, ({seconds}, {seconds}))
from memo_core.errors import MemoError
{imports}
from memo_core.text.reading_limits import LONGEST_WORDS
units = ["a", "A", "_", "_a", "OPEN ", "a b ", " ", "\n", "\r", "\t\n", ",", "a, ", "(", ")", "[", "{{", "}}", "()",
    '"', "'", "`", "```\n", "~~~", "```\nf()\n```\n", "> ", ">\n", "#\n", "1", "1,", "-", " - ", "->", "!",
    "\U0001f44d", "<think>", "/*", "\\\\", "not if ", "cup is a ", "that is not a ", "then ", ":", "a:", ".", "a.", "://a:b",
    "\u0315\u0300", "f()\n"]
wraps = ["{{}}", "{{}}7", "DONE {{}}", "{{{{{{}}}}}}", "{{{{a{{}}}}}}", "({{}}", "```python\n{{}}", "{{}}a(x)",
    '{{{{"corrections": ["{{}}a"], "general": []}}}}']
length = {length}
for unit in units:
    for wrap in wraps:
        text = wrap.format((unit * length)[:length])
        try:
            {call}
        except MemoError:
            pass
print("read")
"""
IMPORTS = "from memo_core.llm.readers import read_code, read_notes, read_plan, read_template"
GROUPS = """
from memo_core.llm.readers.generalised import read_generalised
from memo_core.skillbook.consolidation.function_rules import Group
"""
NAMES = """
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.name_corrections import read_name_corrections
from memo_core.scene.pose import Pose
from memo_core.teachers.answers import meaning_of
scene = SceneGraph((), (), Observation(Pose(), 0.0, False))
"""
ELSEWHERE = """
from memo_core.llm.prompt_values import one_line, quoted, unfenced
from memo_core.text.redaction import Redactor
from memo_core.skillbook.model.keys import Key
from memo_core.study.export import looks_personal
from memo_core.text.terminal import printable
redact = Redactor((("sk-aaaaaaaa", "KEY"),))
"""


@pytest.mark.skipif(os.name != "posix", reason="limits of processor time")
@pytest.mark.parametrize(
    ("imports", "call", "length"),
    [
        (IMPORTS, "read_plan(text, ['cup', 'red cup'])", 20_000),
        (IMPORTS, "read_code(text)", 20_000),
        (IMPORTS, "read_notes(text)", 20_000),
        (IMPORTS, "read_template(text)", 20_000),
        (GROUPS, "read_generalised(text, Group(()), (), ())", 20_000),
        (NAMES, "read_name_corrections(text, scene, 'ana', ['cup']), meaning_of(text)", "LONGEST_WORDS - 60"),
        (NAMES, "read_name_corrections(text, scene, 'ana', ['cup']), meaning_of(text)", 1_000_000),
        (ELSEWHERE, "one_line(text), quoted(text), unfenced(text), redact(text), printable(text)", 50_000),
        (ELSEWHERE, "looks_personal(text, ['P01'], set())", 50_000),
        (ELSEWHERE, "Key.parse('OPEN(' + text.strip('()') + ')')", 50_000),
    ],
    ids=[
        "plan",
        "code",
        "notes",
        "template",
        "generalised",
        "names",
        "long names",
        "prompt and output",
        "export",
        "key",
    ],
)
def test_no_text_takes_the_square_of_its_length(imports, call, length):
    script = READ.format(seconds=PROCESSOR_S, imports=imports, call=call, length=length)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == "read\n", done.stderr[-2000:] or f"more than {PROCESSOR_S} s of the processor"
