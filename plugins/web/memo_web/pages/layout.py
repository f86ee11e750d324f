"""The frame of every page, with navigation and the stop button, and the identity of its visitor."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import attrs
from nicegui import ui
from nicegui.element import Element

from memo_web.pages.guard import visitor_of
from memo_web.pages.run_view import FRESH_S, RunView

_STYLE = """
:root { --nicegui-default-padding: 0.75rem; --nicegui-default-gap: 0.75rem; }
.memo-text { white-space: pre-wrap; overflow-wrap: anywhere; }
.memo-code { white-space: pre; overflow-x: auto; font-family: monospace; font-size: 0.85rem; background: #f4f4f5;
  padding: 0.5rem; border-radius: 4px; max-height: 45vh; overflow-y: auto; }
.memo-code-tall { max-height: calc(100vh - 12rem); white-space: pre-wrap; }
.memo-teach { display: grid; grid-template-columns: minmax(0, 1fr); gap: 1rem; }
.memo-teach:not(.memo-beside) .memo-seen { display: none; }
@media (min-width: 1024px) {
  .memo-beside { grid-template: auto 1fr / repeat(2, minmax(0, 1fr)); }
  .memo-beside .memo-talk, .memo-beside .memo-talk ~ * { grid-column: 2; }
  .memo-beside .memo-seen { grid-area: 1 / 1 / span 2; }
}
.memo-code .now { background: #fde68a; }
.memo-stop-box { display: flex; align-items: center; gap: 0.75rem; }
.memo-stop { background: #b91c1c; color: white; font-size: 1.5rem; font-weight: 700; padding: 0.5rem 1.5rem;
  border: 3px solid white; border-radius: 8px; cursor: pointer; }
.memo-stop:focus-visible { outline: 4px solid #facc15; }
.memo-stop kbd { font-size: 0.8rem; font-weight: 400; border: 1px solid white; border-radius: 3px; padding: 0 0.3rem; }
.memo-stop-state { min-height: 1.5rem; font-weight: 700; }
.memo-stop-note { font-size: 0.8rem; }
.memo-not-live { display: none; background: #fef08a; color: black; padding: 0.5rem 1rem; font-weight: 700; }
.memo-stale .memo-not-live { display: block; }
.memo-stale .memo-live, .memo-old { filter: grayscale(1) opacity(0.45); }
"""


class StopButton(Element, component="stop_button.js"):
    """The stop button with its state, Escape, and the watch over whether the page is live."""

    def __init__(self, view: RunView) -> None:
        super().__init__()
        self._view = view
        self._props.update(beat=view.beat, state=view.stop, fresh_ms=int(1000 * FRESH_S))
        page = self.client.id
        self.on("stop", lambda event: view.press_stop(str(event.args)), throttle=0)
        self.on("pulse", lambda: view.pulse(page))
        self.client.on_delete(lambda: view.gone(page))
        self.client.on_disconnect(lambda: view.gone(page))
        ui.timer(0.1, self._refresh)

    def _refresh(self) -> None:
        if (self._props["beat"], self._props["state"]) != (self._view.beat, self._view.stop):
            self._props.update(beat=self._view.beat, state=self._view.stop)
            self.update()


@attrs.define
class Links:
    """Pages in the navigation, in order: (address, title, whether a visitor is shown the link)."""

    shown: list[tuple[str, str, Callable[[str], bool]]] = attrs.field(factory=list)

    def add(self, address: str, title: str, for_visitor: Callable[[str], bool] = lambda who: True) -> None:
        """Show a page in the navigation of every page.

        Args:
            address: its path, such as ``/teach``.
            title: its name.
            for_visitor: whether a visitor, by identity, is shown the link. The page has to check for itself.
        """
        self.shown.append((address, title, for_visitor))


LINKS = Links()


def visitor() -> str:
    """Identity of the visitor whose page is being built; the same for all pages that one browser opens."""
    request = ui.context.client.request
    return visitor_of(request)


@contextlib.contextmanager
def framed(view: RunView, title: str) -> Iterator[None]:
    """Build a page: its head with navigation and the stop button, and then what the block builds.

    Args:
        view: the run.
        title: title of the page; text of this program only.

    Yields:
        Nothing; elements made in the block are below the head.
    """
    ui.page_title(f"{title} · MEMO")
    ui.add_css(_STYLE)
    with ui.header().classes("items-center justify-between bg-slate-800 q-py-sm"):
        with ui.row().classes("items-center"):
            ui.label("MEMO").classes("text-h6")
            with ui.element("nav").classes("flex gap-3"):
                for address, name, for_visitor in LINKS.shown:
                    if not for_visitor(visitor()):
                        continue
                    link = ui.link(name, address).classes("text-white")
                    if name == title:
                        link.props("aria-current=page").classes("text-bold")
        StopButton(view)
    with ui.element("div").classes("memo-not-live w-full").props("role=alert"):
        ui.label("Not live: what you see is older than 0.5 s, or the connection is lost. The robot may be moving.")
    with ui.column().classes("w-full"):
        yield
