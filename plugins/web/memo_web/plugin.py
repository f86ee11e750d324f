"""The backends that this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, Event, Needs, hookimpl
from memo_web.robot_side.listening import pages_hear
from memo_web.settings import WebSettings


def _teacher(settings: WebSettings) -> Any:
    from memo_web.robot_side.teacher import WebTeacher

    return WebTeacher(settings)


@hookimpl
def memo_teachers() -> list[Backend]:
    return [
        Backend(
            kind="teacher",
            name="web",
            summary="a person in the browser, who sees the robot live and can stop it",
            factory=_teacher,
            config=WebSettings,
            needs=Needs(modules={"nicegui": "nicegui", "PIL": "pillow"}),
        )
    ]


@hookimpl
def memo_event(event: Event) -> None:
    pages_hear(event)
