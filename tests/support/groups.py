"""A group of programs and notes for the tests of generalising, and a good answer to it."""

from __future__ import annotations

import json

from memo_core.skillbook.consolidation.function_rules import Group, Member
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import as_program
from memo_core.skillbook.model.keys import Key

SKILLS = ("look", "get_position", "move_straight", "turn_about")
TAKEN = ("pour", "open_hinged")
OPENED = '''\
def open_hinged(door, angle=85, push_first=False):
    """Open a door that turns about a hinge: hold the handle and lead it along an arc, with 2 cm of room.

    door: name of the door. angle: degrees. push_first: push before pulling, where a note says so.
    """
    if push_first:
        move_straight(get_position(door))
    turn_about(door, angle, room=0.02)
    look()
'''
TEMPLATE = '''\
def open_{0}(name="{0} door", angle={1}):
    """Open the {0}."""
    turn_about(name, angle)
    look()
    # what only this one needs: {2}
'''
CALLS = ("open_hinged('microwave door', angle=80)", "open_hinged('oven door')", "open_hinged('cabinet door')")
NOTES = (
    ("OPEN(microwave)", "Lead the handle along an arc."),
    ("OPEN(oven)", "Pull the handle along an arc, by 85 degrees."),
    ("OPEN(cabinet)", "Leave 2 cm of room."),
)


def entry(number: int, kind: str, key: str, text: str) -> Entry:
    return Entry(number, kind, Key.parse(key), text, "table", None, 1, None, 0, 0, 0.0)


def template(number: int, name: str, angle: int = 85) -> Member:
    text = TEMPLATE.format(name, angle, "x" * 200)
    return Member(entry(number, "template", f"OPEN({name})", text), text, built="a door on an upright hinge")


def call(number: int, key: str, text: str) -> Member:
    return Member(entry(number, "call", key, text), as_program(OPENED, text))


def doors(notes: bool = True) -> Group:
    """Three doors, a microwave's, an oven's and a cabinet's, with a note each."""
    members = (template(1, "microwave", 80), template(2, "oven"), template(3, "cabinet"))
    said = tuple(entry(n, "correction", key, text) for n, (key, text) in enumerate(NOTES, start=4))
    return Group(members, said if notes else ())


def refinement() -> Group:
    """The function ``open_hinged`` with two calls, and a template that it does not do yet."""
    members = (call(1, "OPEN(microwave)", CALLS[0]), call(2, "OPEN(oven)", CALLS[1]), template(3, "cabinet"))
    return Group(members, (), (entry(4, "function", "OPEN(thing)", OPENED),))


def answered(*codes: str, **said: object) -> str:
    """A model's answer: code blocks, then JSON."""
    return "\n".join(f"```python\n{code}```\n" for code in codes) + json.dumps(said)


def good_answer() -> str:
    """Accepted for ``doors``."""
    return answered(
        OPENED,
        functions=[{"name": "open_hinged", "calls": {str(n): text for n, text in enumerate(CALLS, start=1)}}],
        left=[],
        notes=[{"text": "Lead the handle along an arc, by 85 degrees.", "from": [1, 2]}],
        inside=[{"note": 3, "function": "open_hinged"}],
    )
