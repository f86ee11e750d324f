"""The offline backend plans from verbs, what the scene shows and what was done so far."""

from __future__ import annotations

import re

import attrs
import pytest

from memo_core.interfaces.llm import LanguageModelError, Message, Request
from tests.support.offline_prompts import HAND, MODEL, box_with_door, plan, request, scene, thing

HELD = attrs.evolve(HAND, holding=True)


def pantry(opened, *relations, content=(), name="pantry"):
    graph, *_ = box_with_door(name, opened=opened, content=content)
    more = scene(relations=relations).relations
    return attrs.evolve(graph, relations=graph.relations + more)


def test_a_closed_container_is_opened_before_anything_is_put_into_it():
    pear = thing("pear")
    task = "put the pear in the pantry"
    assert plan(pantry(False, content=[pear]), task) == "OPEN(pantry)"
    assert plan(pantry(True, content=[pear]), task, ["OPEN(pantry)"]) == "PICK_UP(pear)"
    held = pantry(True, ("pear", "held"), content=[pear])
    assert plan(held, task, ["OPEN(pantry)", "PICK_UP(pear)"]) == "PLACE(pear, pantry)"
    done = pantry(True, ("pear", "in", "pantry"), content=[pear])
    assert plan(done, task, ["OPEN(pantry)", "PICK_UP(pear)", "PLACE(pear, pantry)"]) == "DONE"


def test_opening_that_did_not_work_is_asked_for_again():
    assert (
        plan(pantry(False, content=[thing("pear")]), "put the pear in the pantry", ["OPEN(pantry)"]) == "OPEN(pantry)"
    )


def test_a_hand_that_is_full_is_emptied_first():
    graph = pantry(False, ("pear", "held"), content=[thing("pear"), thing("fig", (0.4, -0.1, 0.02))])
    assert plan(graph, "put the fig in the pantry") == "PLACE(pear, table)"


def test_open_and_close():
    assert plan(pantry(False), "open the pantry") == "OPEN(pantry)"
    assert plan(pantry(True), "open the pantry", ["OPEN(pantry)"]) == "DONE"
    assert plan(pantry(True), "Please shut the pantry.") == "CLOSE(pantry)"
    assert plan(pantry(False), "close the pantry", ["CLOSE(pantry)"]) == "DONE"


@pytest.mark.parametrize(
    "task", ["stack the bricks", "stack all the bricks on top of each other", "pile up the bricks"]
)
def test_stacking_goes_on_until_everything_stands_on_one_another(task):
    bricks = [thing(f"{c} brick", (0.4, y, 0.02)) for c, y in (("red", 0), ("green", 0.1), ("blue", 0.2))]

    def state(*relations):
        return scene(*bricks, relations=relations)

    assert plan(state(), task) == "PICK_UP(green brick)"
    assert plan(state(("green brick", "held")), task) == "PLACE(green brick, red brick)"
    two = ("green brick", "on", "red brick")
    assert plan(state(two), task) == "PICK_UP(blue brick)"
    assert plan(state(two, ("blue brick", "held")), task) == "PLACE(blue brick, green brick)"
    assert plan(state(two, ("blue brick", "on", "green brick")), task) == "DONE"


def tray_scene(opened, *relations, peg=True):
    chest = thing("bureau", (0.8, 0.1, 0.08), (0.28, 0.32, 0.16), "fixture")
    tray = thing("tray", (0.75, 0.1, 0.08), (0.28, 0.3, 0.12), "part", "bureau")
    handle = thing("tray handle", (0.55, 0.1, 0.08), (0.018, 0.12, 0.018), "part", "tray")
    inside = thing("tray inside", (0.6, 0.1, 0.08), (0.25, 0.27, 0.1), "space", "tray", opening=(0.0, 0.0, 1.0))
    nodes = [chest, tray, handle, *([inside] if opened else []), *([thing("peg")] if peg else [])]
    return scene(*nodes, relations=[("tray", "open" if opened else "closed"), *relations])


@pytest.mark.parametrize(
    "task", ["put the peg away", "put away the peg", "put the peg away in the tray", "tidy the peg away"]
)
def test_putting_away_ends_with_a_closed_container(task):
    done = ["OPEN(tray)", "PICK_UP(peg)", "PLACE(peg, tray)", "CLOSE(tray)"]
    assert plan(tray_scene(False), task) == "OPEN(tray)"
    assert plan(tray_scene(True), task, done[:1]) == "PICK_UP(peg)"
    assert plan(tray_scene(True, ("peg", "held")), task, done[:2]) == "PLACE(peg, tray)"
    assert plan(tray_scene(True, ("peg", "in", "tray")), task, done[:3]) == "CLOSE(tray)"
    assert plan(tray_scene(False, peg=False), task, done) == "DONE"


def test_what_was_put_into_something_that_is_shut_now_stays_there():
    task, done = "put the peg in the tray and close the tray", ["OPEN(tray)", "PICK_UP(peg)", "PLACE(peg, tray)"]
    assert plan(tray_scene(True, ("peg", "in", "tray")), task, done) == "CLOSE(tray)"
    shut = tray_scene(False, peg=False)
    assert plan(shut, task, [*done, "CLOSE(tray)"]) == "DONE"
    assert plan(shut, task) == "OPEN(tray)"
    assert plan(shut, task, [*done, "PICK_UP(peg)", "PLACE(peg, table)"]) == "OPEN(tray)"


def test_what_cannot_be_seen_is_looked_for_in_closed_things():
    first, *_ = box_with_door("pantry")
    second, *_ = box_with_door("locker")
    both = attrs.evolve(first, nodes=first.nodes + second.nodes, relations=first.relations + second.relations)
    assert plan(both, "pick up the plum") == "OPEN(pantry)"
    opened = attrs.evolve(both, relations=(attrs.evolve(both.relations[0], predicate="open"), both.relations[1]))
    assert plan(opened, "pick up the plum", ["OPEN(pantry)"]) == "OPEN(locker)"
    assert plan(both, "take the plum out of the locker") == "OPEN(locker)"


def test_clauses_follow_one_another():
    graph = pantry(False, content=[thing("pear")])
    assert plan(graph, "open the pantry and then pick up the pear") == "OPEN(pantry)"
    opened = pantry(True, content=[thing("pear")])
    assert plan(opened, "open the pantry and then pick up the pear", ["OPEN(pantry)"]) == "PICK_UP(pear)"
    held = pantry(True, ("pear", "held"), content=[thing("pear")])
    assert plan(held, "open the pantry and then pick up the pear", ["OPEN(pantry)", "PICK_UP(pear)"]) == "DONE"


def test_an_unknown_verb_becomes_a_subtask_of_its_own_once():
    graph = scene(thing("lamp"))
    assert plan(graph, "polish the lamp") == "POLISH(lamp)"
    assert plan(graph, "polish the lamp", ["POLISH(lamp)"]) == "DONE"


def test_what_it_cannot_plan_is_an_answer_in_words_and_no_error_of_the_model():
    from memo_core.llm.readers import Unreadable, read_plan

    for task, reason in (("put the trash away", "see nothing called that; there are lamp"), ("sing", "do not know")):
        answer = plan(scene(thing("lamp")), task)
        assert reason in answer
        with pytest.raises(Unreadable):
            read_plan(answer, ["lamp"])


def test_a_prompt_without_what_is_needed_is_refused_naming_it():
    whole = "\n".join(m.text for m in request("plan", pantry(False), task="open the pantry", done=[]).messages)
    for heading, named in (("## Task", "task"), ("## Scene", "scene"), ("## Done so far", "done")):
        cut = whole.replace(heading, "## Something else", 1)
        with pytest.raises(LanguageModelError, match=f"(?i){named}"):
            MODEL.answer(Request("plan", (Message("user", cut),)))
    with pytest.raises(LanguageModelError, match="no title"):
        MODEL.answer(Request("plan", (Message("user", "hello"),)))
    with pytest.raises(LanguageModelError, match="title"):
        MODEL.answer(Request("plan", (Message("user", "# Sing a song\n"),)))


def test_a_row_that_cannot_be_read_is_named():
    text = "\n".join(m.text for m in request("plan", pantry(False), task="open the pantry", done=[]).messages)
    broken = re.sub(r"(\| pantry door \| part \| pantry \|[^|]*\|)[^|]*", r"\1 somewhere ", text)
    with pytest.raises(LanguageModelError, match="pantry door"):
        MODEL.answer(Request("plan", (Message("user", broken),)))


# -- what people said about plans --------------------------------------------------------------------------------------


@attrs.frozen
class Said:
    subtask: str
    words: str


@attrs.frozen
class PlanNote:
    task: str
    text: str


def taught(graph, task, *words, notes=(), done=()):
    corrected = [Said("PICK_UP(pear)", one) for one in words]
    told = [PlanNote("put the bread in the oven", one) for one in notes]
    asked = request("plan", graph, task=task, done=list(done), corrected=corrected, notes=told)
    answer = MODEL.answer(asked)
    return answer.text, answer.not_understood


PEAR = thing("pear")
PUT = "put the pear on the board"
BOARD = thing("board", (0.4, 0.3, 0.01), (0.2, 0.2, 0.02))


@pytest.mark.parametrize(
    "words",
    [
        "open the pantry first",
        "You have to open the pantry before you pick up the pear.",
        "no, first open the pantry",
        "First open the pantry, then take the pear!",
    ],
)
def test_a_step_asked_for_in_this_run_is_planned_before_the_rest_and_once(words):
    graph = pantry(False, content=[PEAR, BOARD])
    assert taught(graph, PUT)[0] == "PICK_UP(pear)"
    assert taught(graph, PUT, words)[0] == "OPEN(pantry)"
    opened = pantry(True, content=[PEAR, BOARD])
    assert taught(opened, PUT, words, done=["OPEN(pantry)"])[0] == "PICK_UP(pear)"


def test_what_was_forgotten_is_done_after_the_rest():
    graph = pantry(True, ("pear", "on", "board"), content=[PEAR, BOARD, thing("fig", (0.4, -0.1, 0.02))])
    assert taught(graph, PUT)[0] == "DONE"
    assert taught(graph, PUT, "you forgot the fig")[0] == "PICK_UP(fig)"
    assert taught(graph, PUT, "you forgot to close the pantry")[0] == "CLOSE(pantry)"
    assert taught(graph, PUT, "a bit lower please")[0] == "DONE", "a remark about how it is done plans nothing"


def test_a_note_from_elsewhere_is_followed_only_where_it_concerns_the_step():
    graph = pantry(False, content=[PEAR, BOARD])
    note = "Close the pantry before you put something on the board."
    opened = pantry(True, content=[PEAR, BOARD])
    assert taught(opened, PUT, notes=[note])[0] == "PICK_UP(pear)", "the step has nothing to do with the pantry"
    assert taught(graph, PUT, notes=["Open the pantry first."])[0] == "PICK_UP(pear)"
    held = pantry(False, ("pear", "held"), content=[PEAR])
    put = "put the pear on the pantry"
    assert taught(held, put)[0] == "PLACE(pear, pantry)"
    assert taught(held, put, notes=["Open the pantry's door before putting something there."])[0] == "OPEN(pantry)"
    assert taught(graph, PUT, notes=["Set a napkin at each place."])[1] == ("Set a napkin at each place.",)


@pytest.mark.parametrize(("opening", "done"), [((0.0, 0.0, 1.0), True), ((-1.0, 0.0, 0.0), False)])
def test_what_lies_in_a_rimmed_tray_is_on_it_and_what_is_in_a_cabinet_is_not(opening, done):
    tray = thing("holder", (0.6, 0.1, 0.02), (0.3, 0.3, 0.04), "fixture")
    inside = thing("holder inside", (0.6, 0.1, 0.03), (0.28, 0.28, 0.03), "space", "holder", opening=opening)
    graph = scene(tray, inside, thing("peg", (0.6, 0.1, 0.04)), relations=[("peg", "in", "holder inside")])
    assert (plan(graph, "put the peg on the holder") == "DONE") is done
