"""Catches, bolts and push latches on the joint of a door or drawer."""

from __future__ import annotations

from memo_core.plugin import Above, AllOf, Below, Condition, Lasting, Lock, Locked, Mechanism, Spring, Times


def push_latch(joint: str, lowest: float, pushed: float) -> tuple[Mechanism, ...]:
    """The joint, whose range begins at ``lowest`` < 0, is kept shut at 0 until it is pushed in beyond ``pushed``, and
    again when it is pushed in that far once more."""
    push = Below(joint, pushed, slack=-pushed / 2)
    return (Lock("latch", joint, (lowest, 0.0), until=push, again=Times(push, 1)),)


def lifted_bolt(thing: str, joint: str, play: float) -> tuple[Mechanism, ...]:
    """The joint is locked but for ``play`` (rad or m) unless the handle is lifted by 18 mm. Pulled to the end of its
    play the bolt jams, so that lifting comes first. It locks again with the handle down and the joint shut."""
    lifted = AllOf((Above(f"{thing}/lift", 0.018), Below(joint, play / 2)))
    back = AllOf((Below(f"{thing}/lift", 0.008), Below(joint, play)))
    return (Lock("bolt", joint, (0.0, play), until=lifted, again=back),)


def half_way_catch(joint: str, stop: float, strain: float, hard: float, stiffness: float) -> tuple[Mechanism, ...]:
    """From ``stop`` on a springy catch holds back; ``hard`` beyond it nothing moves. It gives way once it has been
    strained by ``strain`` twice, and is in place again with the joint back at half of ``stop``."""
    strained = Above(joint, stop + strain, slack=strain / 2)
    return (
        Lock("catch", joint, (0.0, stop + hard), until=Times(strained, 2), again=Below(joint, stop / 2)),
        Spring(joint, stiffness, stop, when=AllOf((Above(joint, stop), Locked("catch")))),
    )


def button_latch(joint: str, open_to: float, button: str, pressed: float, seconds: float) -> tuple[Mechanism, ...]:
    """The joint is kept shut at 0 until ``button`` has been ``pressed`` (m) for so many seconds without a break; it
    locks again when it is shut after that."""
    held: Condition = Lasting(Above(button, pressed, slack=0.001), seconds)
    shut = Times(Below(joint, 0.01 * open_to), 1)
    return (Lock("catch", joint, (0.0, 0.01 * open_to), until=held, again=shut),)
