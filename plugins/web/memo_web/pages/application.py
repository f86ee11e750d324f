"""The web application: the stop, pictures and meshes, and the pages, behind the guard."""

from __future__ import annotations

import importlib
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import HTMLResponse
from nicegui import app as nicegui_app, ui
from starlette.middleware.base import RequestResponseEndpoint

from memo_web.pages.guard import Allowed, Guard
from memo_web.pages.run_view import RunView
from memo_web.pages.study_state import study_of

# Modules with a function ``add_pages(view)``, in the order of their links.
PAGES = (
    "memo_web.pages.participant",
    "memo_web.pages.teach",
    "memo_web.pages.replay",
    "memo_web.pages.why_pages",
    "memo_web.pages.operator",
)

PREPARING = """<!doctype html><html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="1">
<title>MEMO</title></head>
<body style="font-family: sans-serif; margin: 3rem">The study is being prepared …</body></html>
"""  # before it is known who is who, nobody is shown anything


def application(view: RunView, allowed: Allowed) -> Any:
    """Build the application.

    Args:
        view: the run.
        allowed: what the guard lets in.

    Returns:
        An ASGI application.
    """
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)

    @app.middleware("http")
    async def await_study(request: Request, go_on: RequestResponseEndpoint) -> Response:
        own = request.method == "GET" and not request.url.path.startswith("/_nicegui")
        if own and view.for_study and not study_of(view).held:
            return HTMLResponse(PREPARING, status_code=503)
        return await go_on(request)

    @app.post("/stop")
    async def stop(request: Request) -> dict[str, str]:
        body = await request.json()
        view.press_stop(str(body.get("press", "")) if isinstance(body, dict) else "")
        return {"state": view.stop}

    @app.get("/picture/{camera:path}")
    async def picture(camera: str, request: Request) -> Response:
        taken = view.pictures.get(camera)
        if taken is None or not view.may_answer(request.state.visitor):
            return Response(status_code=404)
        return Response(taken.data, media_type="image/jpeg", headers={"Cache-Control": "no-store"})

    @app.get("/mesh/{number}.stl")
    async def mesh(number: int) -> Response:
        data = view.meshes.get(number)
        return Response(data, media_type="model/stl") if data is not None else Response(status_code=404)

    for module in PAGES:
        importlib.import_module(module).add_pages(view)
    nicegui_app.config.socket_io_js_transports = ["websocket"]
    ui.run_with(
        app,
        title="MEMO",
        favicon="🤖",
        reconnect_timeout=5.0,
        show_welcome_message=False,
        gzip_middleware_factory=None,
    )
    return Guard(app, allowed)
