"""Notes and templates of the offline backend, and the rules every language backend keeps."""

from __future__ import annotations

import ast
import json

import attrs
import pytest
from memo_offline.model import OfflineModel

from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Usage
from memo_core.llm.readers import read_code, read_notes, read_plan, read_template
from memo_core.testing.llm import check_language_model, user
from tests.support.offline_prompts import (
    ARC,
    MODEL,
    Entry,
    box_with_door,
    code_request,
    request,
    run,
    scene,
    thing,
    unfenced,
    write,
)

DOOR, *_ = box_with_door()


def notes(words, graph=DOOR, subtask="OPEN(crate)"):
    answer = MODEL.answer(request("feedback", graph, task="t", subtask=subtask, code="x()", ended="done", words=words))
    return read_notes(answer.text), answer.not_understood


# -- phase 3 ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words",
    [
        "no, pull the handle around in an arc",
        "you have to follow a curve around its hinge",
        "don't pull it straight back",
    ],
)
def test_different_words_for_one_thing_become_one_note(words):
    said, missed = notes(words)
    assert said.corrections == (ARC,)
    assert missed == ()


def test_a_reason_becomes_a_general_statement_and_an_instruction_alone_does_not():
    said, _ = notes("you lost it because the door turns, move your hand along an arc around the hinge")
    assert said.corrections and any("Doors swing" in g for g in said.general)
    assert notes("no, pull the handle around in an arc")[0].general == ()
    assert notes("a bit to the left")[0].general == ()


def test_an_exclamation_beside_a_correction_is_no_note():
    assert notes("No!! Swing the handle around in an arc")[0].corrections == (ARC,)
    assert "What should be different?" in notes("No!!")[0].unclear  # all there was: no note, and said so


def test_always_is_general():
    said, _ = notes("always open the gripper first")
    assert said.general == ("Open the fingers first.",) and said.corrections == ()


@pytest.mark.parametrize(
    ("words", "kept"),
    [
        ("go 3 cm lower", "3 cm"),
        ("turn the hand by a quarter turn", "a quarter turn"),
        ("open it 40 degrees", "40 degrees"),
    ],
)
def test_amounts_are_kept(words, kept):
    assert kept in " ".join(notes(words)[0].corrections)


def test_words_that_are_not_understood_are_kept_beside_those_that_are_and_reported():
    said, missed = notes("Go 3 cm higher. The crate perambulated widdershins.")
    assert said.corrections[1] == "The crate perambulated widdershins."
    assert missed


@pytest.mark.parametrize("words", ["no, that's not right", "that was wrong, try again", "perambulate it widdershins"])
def test_of_words_that_teach_nothing_no_note_is_made_but_why(words):
    said, _ = notes(words)
    assert said.corrections == said.general == () and said.unclear.startswith(
        ("none of these words is known", "something is denied")
    )


def test_coordinates_do_not_get_into_notes():
    said, _ = notes("Go 3 cm higher. You stood at (0.45 0.2 0.1) like a heron.")
    assert "heron" in said.corrections[1] and "0.45" not in said.corrections[1]


@pytest.mark.parametrize(
    "words",
    ["pull it along an arc", "3 cm higher", "come from above", "open the gripper first", "do it twice",
     "swing it the other way",
     "grip it by the rim", "let go of it", "tilt the hand by 20 degrees", "go further", "more gently"],
)  # fmt: skip
def test_what_is_noted_means_the_same_when_it_is_read_again(words):
    said, _ = notes(words)
    first = write(DOOR, "OPEN(crate)", [Entry(words, "OPEN(crate)")])[0]
    again = write(DOOR, "OPEN(crate)", [Entry(note, "OPEN(crate)") for note in said.corrections])[0]

    def program(code):
        return ast.dump(ast.parse(code))

    assert program(first) == program(again)


# -- phase 4 ----------------------------------------------------------------------------------------------------------


def template(code, graph=DOOR, subtask="OPEN(crate)"):
    return read_template(MODEL.answer(request("template", graph, subtask=subtask, code=code)).text)


@pytest.mark.process
@pytest.mark.parametrize(
    ("subtask", "graph"),
    [
        ("OPEN(crate)", DOOR),
        ("PICK_UP(brick)", scene(thing("brick"))),
        ("PLACE(brick, tile)", scene(thing("brick"), thing("tile"))),
    ],
)
def test_code_becomes_one_documented_function_of_names_and_amounts_that_does_the_same(subtask, graph):
    code = write(graph, subtask, [ARC] if subtask.startswith("OPEN") else [])[0]
    text = template(code, graph, subtask)
    function = next(node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef))
    names = {ast.literal_eval(default) for default in function.args.defaults}
    assert {node.label for node in graph.nodes} & names
    body = text.split('"""', 2)[2]
    assert not any(f"'{node.label}'" in body for node in graph.nodes)
    assert run(f"{text}\n\n{function.name}()\n", graph) == run(code, graph)


def test_a_place_written_as_numbers_becomes_a_parameter_without_a_default():
    text = template(
        'open_gripper()\nmove_to([0.45, -0.3, 0.2], top_orientation())\nmove_straight(get_position("crate handle"))\n'
    )
    function = next(node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef))
    assert [a.arg for a in function.args.args] == ["place_1", "crate_handle"]
    assert len(function.args.defaults) == 1


@pytest.mark.process
def test_an_amount_is_not_mixed_up_with_a_local_variable_of_its_name():
    code = "SHARE = 0.5\nfor share in (0.2, 0.4):\n    move_to([0.4, SHARE * share, 0.3], top_orientation())\n"
    text = template(code)
    name = next(node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)).name
    assert run(f"{text}\n\n{name}()\n", DOOR) == run(code, DOOR)


def test_code_that_does_not_parse_is_refused():
    with pytest.raises(LanguageModelError, match="does not parse"):
        template("def f(:\n")


@attrs.frozen
class Tried:
    code: str = "x()"
    printed: str = ""
    ended: str = "MotionError: cannot be reached"


def test_where_no_other_way_is_known_the_code_is_the_same_to_the_letter():
    """The loop reads that as "no other idea" and asks the person, who would otherwise watch the same pull thrice."""
    texts = {MODEL.answer(code_request(DOOR, "OPEN(crate)", attempts=[Tried()] * failed)).text for failed in range(3)}
    assert len(texts) == 1


def test_code_that_ended_in_an_error_is_not_written_again():
    graph = scene(thing("brick"), thing("tile", (0.5, 0.2, 0.01), (0.1, 0.1, 0.02)))
    texts = []
    for failed in range(3):
        asked = code_request(graph, "PLACE(brick, tile)", attempts=[Tried()] * failed)
        code = unfenced(MODEL.answer(asked).text)
        texts.append(ast.dump(ast.parse(code)))
    assert len(set(texts)) == 3


# -- every phase ------------------------------------------------------------------------------------------------------


def all_phases():
    code = write(DOOR, "OPEN(crate)", [ARC])[0]
    return [
        request("plan", DOOR, task="open the crate", done=[]),
        code_request(DOOR, "OPEN(crate)", [ARC]),
        request("feedback", DOOR, task="t", subtask="OPEN(crate)", code="x()", ended="done", words="in an arc"),
        request("template", DOOR, subtask="OPEN(crate)", code=code),
    ]


def test_the_offline_backend_conforms():
    check_language_model(OfflineModel, all_phases(), deterministic=True)


def test_answers_are_what_the_loop_reads():
    plan, code, feedback, template_answer = (MODEL.answer(r).text for r in all_phases())
    assert str(read_plan(plan)) == "OPEN(crate)"
    read_code(code)
    read_notes(feedback)
    read_template(template_answer)
    json.loads(feedback)


class _Wrong(LanguageModel):
    name = "wrong"

    def __init__(self, spoil):
        self.spoil, self.asked = spoil, 0
        self.name = "" if spoil == "name" else "wrong"

    def open(self): ...

    def close(self): ...

    def answer(self, request, on_text=None, cancelled=None):
        self.asked += 1
        if not request.messages:
            if self.spoil == "errors":
                raise KeyError("messages")
            if self.spoil == "no error":
                return Answer("yes")
            raise LanguageModelError(self.name, "no messages")
        text = request.messages[-1].text[::-1]
        text = {"varies": "always this", "text": " ", "deterministic": f"{text}{self.asked}",
                "messages alone": text + request.phase, "stateless": text}.get(self.spoil, text)  # fmt: skip
        if on_text is not None:
            on_text(text[:1] if self.spoil == "on_text" else text)
        usage = Usage(-1 if self.spoil == "usage" else 1, 1)
        return "text" if self.spoil == "Answer" else Answer(text, usage=usage, model="wrong-1")


@pytest.mark.parametrize(
    ("spoil", "rule"),
    [(rule, rule) for rule in ("name", "varies", "text", "on_text", "usage", "deterministic", "messages alone")]
    + [("errors", "nothing_asked_is_an_error"), ("Answer", "returns an Answer"), ("no error", "without messages")],
)
def test_the_suite_rejects_a_backend_that_breaks(spoil, rule):
    with pytest.raises(AssertionError, match=rule):
        check_language_model(lambda: _Wrong(spoil), [user("one"), user("two")], deterministic=True)


def test_the_suite_rejects_a_backend_that_remembers():
    class Remembering(_Wrong):
        def answer(self, request, on_text=None, cancelled=None):
            answer = super().answer(request, on_text, cancelled)
            self.seen = [*getattr(self, "seen", []), answer.text]
            return attrs.evolve(answer, text=answer.text + self.seen[0])

    with pytest.raises(AssertionError, match=r"stateless|deterministic|on_text"):
        check_language_model(lambda: Remembering(""), [user("one"), user("two")], deterministic=True)


def test_a_backend_that_is_not_open_says_so():
    with pytest.raises(LanguageModelError, match="not been opened"):
        OfflineModel().answer(all_phases()[0])
