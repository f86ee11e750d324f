"""Books with planted contradictions and repetitions, for measuring what clustering does to them.

The labels come from how a book is made: every statement is drawn from a *fact* (a matter and what is said of it), and
every fact has a mark, a pattern by which it is recognised in any wording. It shares no code with clustering.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Sequence

import attrs

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.keys import Key

_DENIAL = re.compile(r"\b(?:not|don't|never|instead of|rather than|without)\b")


@attrs.frozen
class Fact:
    """One thing that can be said of a matter. ``doc`` is how a template's docstring puts it, ``code`` a line of one
    that does it ("" where code alone would not show it). A mark with a denial before it in the clause does not count:
    "along an arc, not straight" does not state that it is straight."""

    name: str
    said: tuple[str, ...]
    mark: str  # regular expression over lower-case text
    doc: tuple[str, ...] = ()
    code: str = ""

    def stated_in(self, texts: Iterable[str]) -> bool:
        """Whether a text states it."""
        return any(
            not _DENIAL.search(re.split(r"[.,;:]", text.lower()[: found.start()])[-1])
            for text in texts
            for found in re.finditer(self.mark, text.lower())
        )

    def done_by(self, template: str) -> bool:
        """Whether a template says it or, where code shows it, does it."""
        return self.stated_in([template]) or bool(self.code and self.code in template)


MATTERS: dict[str, tuple[Fact, Fact]] = {
    "path": (
        Fact(
            "arc",
            (
                "Lead the handle along an arc about the hinge.",
                "Swing it open around its hinge.",
                "It turns on a hinge: follow a curve with your hand.",
                "Move the hand in a circle around the hinge edge.",
                "Go round with the door while you pull.",
            ),
            r"\b(?:arcs?|curved?|swings?|circle|circular|go round|goes round|hinges?)\b",
            ("Leads the handle along an arc about the hinge edge.", "Swing the handle round in a curve."),
            "turn_about(get_position(name), [0.0, 0.0, 1.0], math.radians(angle))",
        ),
        Fact(
            "straight",
            (
                "Pull it straight out.",
                "Pull the handle straight back towards you in one line.",
                "It slides, so pull in a straight line.",
                "Draw it straight out and do not turn.",
            ),
            r"\b(?:straight|in one line|slides?)\b",
            ("Pulls the handle straight out in one line.", "Draw it straight towards the robot."),
            "move_straight([-length, 0.0, 0.0])",
        ),
    ),
    "grip": (
        Fact(
            "by the handle",
            (
                "Take hold of the handle.",
                "Grip the bar of the handle.",
                "Hold it by the handle.",
                "Use the handle for that.",
            ),
            r"\b(?:(?:by|of|grips?|grab|grasps?|hold|use) (?:it by )?(?:the |its )?(?:handle|bar|grip|knob))\b",
            ("Grasps the handle.", "Take hold of the bar of the handle."),
        ),
        Fact(
            "by the rim",
            ("Hold it by the rim.", "Take hold of the rim.", "Grip the upper rim, there it is thin."),
            r"\brim\b",
            ("Grasps it by the rim.", "Take hold of the rim."),
        ),
    ),
    "approach": (
        Fact(
            "from above",
            ("Come from above.", "Approach it from the top.", "Reach down on it from above."),
            r"\bfrom (?:above|the top|overhead)\b",
            ("Comes from above.", "Approach from the top."),
            "hold = top_orientation()",
        ),
        Fact(
            "from the front",
            ("Reach in from the front.", "Approach it from the front.", "Come at it from the front side."),
            r"\bfrom the front\b",
            ("Comes from the front.", "Approach from the front."),
        ),
    ),
    "force": (
        Fact(
            "gently",
            (
                "Squeeze it gently.",
                "Grip it softly.",
                "Use little force when you hold it.",
                "Do not squeeze it so hard.",
            ),
            r"\b(?:gently|gentle|softly|lightly|little force|less force|do not squeeze .*hard)\b",
            ("Holds it gently.", "Grip softly."),
            "close_gripper(15)",
        ),
        Fact(
            "firmly",
            ("Grip it firmly.", "Hold it tighter.", "Squeeze it hard so that it cannot slip."),
            r"\b(?:firmly|tight(?:er|ly)?|(?<!so )(?<!too )hard(?:er)?)\b",
            ("Holds it firmly.", "Grip hard."),
            "close_gripper(70)",
        ),
    ),
    "speed": (
        Fact(
            "slowly",
            ("Move slowly.", "Take your time, go slower.", "Do it slowly."),
            r"\bslow(?:ly|er)?\b",
            ("Moves slowly.", "Go slowly."),
        ),
        Fact(
            "fast",
            ("Move faster.", "Do it quickly.", "Be quick, go fast."),
            r"\b(?:fast(?:er)?|quick(?:ly|er)?)\b",
            ("Moves fast.", "Go quickly."),
        ),
    ),
    "extent": (
        Fact(
            "90 degrees",
            ("Open it by 90 degrees.", "Turn it through ninety degrees.", "Lead it around 90 degrees."),
            r"\b(?:90|ninety)\b",
            ("Leads it through 90 degrees.",),
        ),
        Fact(
            "40 degrees",
            ("Open it by 40 degrees only.", "Lead it through 40 degrees, no more.", "Turn it about forty degrees."),
            r"\b(?:40|forty)\b",
            ("Leads it through 40 degrees.",),
        ),
    ),
    "end": (
        Fact(
            "let go",
            ("Let go of it at the end.", "Release it afterwards.", "Open the fingers again when it is done."),
            r"\b(?:let go|lets go|letting go|releas\w+|open the fingers again)\b",
            ("Lets go of it afterwards.", "Release it at the end."),
        ),
        Fact(
            "hold on",
            ("Keep hold of it.", "Hold on to it, you need it afterwards.", "Keep gripping it when you are done."),
            r"\b(?:keeps? hold|holds? on|keeps? gripping|keep it in the hand)\b",
            ("Keeps hold of it.",),
        ),
    ),
    "beginning": (
        Fact(
            "fingers open",
            ("Open the gripper first.", "Open your fingers before you reach for it.", "Start with the fingers open."),
            r"\b(?:first open|open (?:the |your )?(?:gripper|fingers|hand) (?:first|before)|fingers open)\b",
            ("First open the gripper.", "Open the gripper first."),
        ),
        Fact(
            "fingers closed",
            ("Close the gripper first.", "Go in with closed fingers.", "Close the fingers before you go there."),
            r"\b(?:first close|close (?:the |your )?(?:gripper|fingers|hand) (?:first|before)|closed (?:fingers|hand)"
            r"|fingers closed)\b",
            ("First close the gripper.",),
        ),
    ),
}

ASIDES: tuple[Fact, ...] = (  # no template speaks of them
    Fact(
        "light",
        ("Wait until the light goes out.", "Do not begin before the light is off."),
        r"(?:do not begin .*)?\blight\b",
    ),
    Fact("wall", ("Keep 3 cm away from the wall.", "Stay 3 cm clear of the wall."), r"\bwall\b"),
    Fact("cable", ("Mind the cable behind it.", "Watch out for the cable at the back."), r"\bcable\b"),
    Fact(
        "glass",
        ("Do not touch the glass.", "Never touch the glass pane."),
        r"(?:(?:not|never) (?:\w+ )?)?touch\w* .*\bglass\b",
    ),
    Fact("look", ("Look again before you start.", "Look first."), r"\blook\b"),
    Fact("plate", ("Take the plate away beforehand.",), r"\bplate\b"),
    Fact("beep", ("Wait for the beep.", "Wait until it has beeped."), r"\bbeep"),
    Fact("sticks", ("When it sticks, pull 2 cm further.", "If it sticks, go on for 2 cm."), r"\bsticks?\b"),
    Fact("twice", ("Press twice.", "Press it two times."), r"\b(?:twice|two times)\b"),
    Fact(
        "scratch",
        ("Do not scratch the paint.", "Be careful not to scratch the paint."),
        r"(?:(?:do not|not to|never|without|avoid) )?scratch",
    ),
    Fact("higher", ("Go 4 cm higher.",), r"\b4 cm\b"),
    Fact("nearest", ("Take the one that is nearest to the edge.",), r"\bnearest\b"),
    Fact("dry", ("Dry it with the cloth first.",), r"\bcloth\b"),
    Fact("hot", ("Careful, it is hot inside.", "Inside it is hot, so do not stay there."), r"\bhot\b"),
)
GENERAL: tuple[Fact, ...] = (
    Fact(
        "doors swing",
        ("Doors swing: lead them along an arc.", "A door turns on its hinge, so follow an arc with it."),
        r"\barc\b",
    ),
    Fact("fragile", ("Hold soft things with little force.", "Anything soft is held with little force."), r"\bsoft\b"),
    Fact(
        "cables",
        ("Never pull on a cable.", "Do not pull on cables."),
        r"(?:(?:do not|never|don't) )?pull\w* .*\bcables?\b",
    ),
    Fact("people", ("Keep away from people's hands.", "Stay away from people's hands."), r"\bpeople"),
    Fact("ask", ("Say so when something is in the way.",), r"\bin the way\b"),
)
ACTIONS = ("open", "close", "pull", "lift", "push", "turn on", "insert", "wipe")
_THINGS = """
oven fridge cupboard chest locker hatch crate wardrobe washer dishwasher freezer trunk bin tin casket closet safe
mailbox toolbox breadbox pantry aquarium hamper kiln
"""
THINGS = tuple(_THINGS.split())


@attrs.frozen
class Planted:
    """One statement of a key: ``fate`` is ``gone`` (it contradicts a template) or ``kept``."""

    key: Key | None  # None: a general statement
    text: str
    facts: tuple[tuple[Fact, str], ...]  # with the fate of each


@attrs.frozen
class PlantedBook:
    """What was written into a book."""

    statements: tuple[Planted, ...]
    templates: tuple[tuple[Key, str], ...]


@attrs.frozen
class Verdict:
    """How a book does against its labels. Shares are of statements; ``repetitions`` counts facts said several times
    that are to be kept, ``repetitions_left`` those that still are in several entries."""

    statements: int
    contradictions: int
    contradictions_gone: int
    rest: int
    rest_kept: int
    rest_in_template: int  # not in any entry, but in the template of their key
    repetitions: int
    repetitions_left: int
    missed: tuple[str, ...]  # contradictions that are still there, and what was lost

    @property
    def gone_share(self) -> float:
        return self.contradictions_gone / self.contradictions if self.contradictions else 1.0

    @property
    def kept_share(self) -> float:
        return self.rest_kept / self.rest if self.rest else 1.0


def plan_book(keys: int, seed: int = 0) -> PlantedBook:
    """What to write: per key two to four matters, most with a template, several people's words on each."""
    rng = random.Random(seed)
    names = [Key(action, (thing,)) for thing in THINGS for action in ACTIONS]
    rng.shuffle(names)
    statements: list[Planted] = []
    templates: list[tuple[Key, str]] = []
    for key in names[:keys]:
        matters = rng.sample(list(MATTERS), rng.randint(2, 4))
        chosen = {matter: rng.choice(MATTERS[matter]) for matter in matters}
        known = rng.random() < 0.8  # else no code has worked yet, and nothing may be given up
        said = _statements(rng, key, chosen, known)
        rng.shuffle(said)
        statements += said
        if known:
            templates.append((key, _template(rng, key, list(chosen.values()))))
    for fact in GENERAL:
        statements += [Planted(None, text, ((fact, "kept"),)) for text in fact.said]
    return PlantedBook(tuple(statements), tuple(templates))


def write_book(book: Skillbook, planted: PlantedBook) -> None:
    """Teach it all, statement by statement, each by one of four people; the templates last, as they come about."""
    for number, one in enumerate(planted.statements):
        about = one.key or Key("open", ("thing",))
        feedback = book.record_feedback(one.text, f"person {number % 4}", subtask=str(about))
        book.add_lessons(feedback, about, [one.text] if one.key else [], [] if one.key else [one.text])
    for key, code in planted.templates:
        book.add_template(book.record_feedback("", "person 0", subtask=str(key), kind="approval"), key, code)


def judge_book(book: Skillbook, planted: PlantedBook) -> Verdict:
    """Read what the book holds now and hold it against the labels."""
    texts: dict[Key | None, list[str]] = {}
    for entry in book.entries():
        if entry.kind != "template":
            texts.setdefault(entry.key if entry.key.objects else None, []).append(entry.text)
    codes = {entry.key: entry.text for entry in book.entries("template")}
    gone = kept = contradictions = rest = in_template = 0
    missed: list[str] = []
    times: dict[tuple[Key | None, str], tuple[Fact, int]] = {}
    for one in planted.statements:
        now = texts.get(one.key, [])
        for fact, fate in one.facts:
            stated = fact.stated_in(now)
            if fate == "gone":
                contradictions, gone = contradictions + 1, gone + (not stated)
            else:
                rest, kept = rest + 1, kept + stated
                times[one.key, fact.name] = (fact, times.get((one.key, fact.name), (fact, 0))[1] + 1)
                if not stated and one.key is not None and fact.done_by(codes.get(one.key, "")):
                    in_template += 1
                    continue
            if stated == (fate == "gone"):
                missed.append(f"{one.key or '*'}: {one.text!r} ({fact.name}) should be {fate}")
    several = {where: fact for where, (fact, count) in times.items() if count > 1}
    left = sum(sum(fact.stated_in([text]) for text in texts.get(key, [])) > 1 for (key, _), fact in several.items())
    return Verdict(
        len(planted.statements),
        contradictions,
        gone,
        rest,
        kept,
        in_template,
        len(several),
        left,
        tuple(dict.fromkeys(missed)),
    )


def _statements(rng: random.Random, key: Key, chosen: dict[str, Fact], known: bool) -> list[Planted]:
    said: list[Planted] = []
    for matter, fact in chosen.items():
        other = next(one for one in MATTERS[matter] if one is not fact)
        fate = "gone" if known else "kept"
        said += [Planted(key, text, ((fact, "kept"),)) for text in _some(rng, fact.said, 1, 3)]
        said += [Planted(key, text, ((other, fate),)) for text in _some(rng, other.said, 0, 2)]
    asides = rng.sample(ASIDES, rng.randint(1, 3))
    for aside in asides:
        said += [Planted(key, text, ((aside, "kept"),)) for text in _some(rng, aside.said, 1, 2)]
    if rng.random() < 0.3:  # two things in one breath, one of them wrong
        matter = rng.choice(list(chosen))
        other = next(one for one in MATTERS[matter] if one is not chosen[matter])
        first, second = rng.choice(other.said).rstrip("."), rng.choice(asides).said[0]
        text = f"{first}, and {second[0].lower()}{second[1:]}"
        aside = next(one for one in asides if one.said[0] == second)
        said.append(Planted(key, text, ((other, "gone" if known else "kept"), (aside, "kept"))))
    return said


def _some(rng: random.Random, phrases: Sequence[str], least: int, most: int) -> list[str]:
    return rng.sample(list(phrases), min(len(phrases), rng.randint(least, most)))


def _template(rng: random.Random, key: Key, facts: list[Fact]) -> str:
    """A function that does all of ``facts``. Of some the code alone tells."""
    told, lines = [], []
    for fact in facts:
        if fact.code and rng.random() < 0.3:
            lines.append(fact.code)
        else:
            told.append(rng.choice(fact.doc))
            lines += [fact.code] if fact.code else []
    angle = next((int(f.name.split()[0]) for f in facts if f.name.endswith("degrees")), 60)
    does = " ".join(told) or "Positions are read when it runs."
    body = "\n".join(f"    {line}" for line in ["move_to(get_position(name), hold)", *lines, "look()"])
    verb = key.action.replace(" ", "_")
    parameters = "name, hold=None, length=0.2" + (f", angle={angle}" if any("angle" in line for line in lines) else "")
    about = f"{key.action.capitalize()} the thing called name."
    return f'def {verb}_thing({parameters}):\n    """{about}\n\n    {does}\n    """\n    import math\n\n{body}\n'
