"""The process of the web server: ``python -m memo_web.pages.program MESSAGES STOP``, two inherited sockets.

It ends with its standard input, which the run's process holds.
"""

from __future__ import annotations

import asyncio
import os
import socket
import sys
import tempfile
from pathlib import Path
from typing import Any

from memo_core.plugin import end_with_input
from memo_web.channel import Channel, StopLine


def main() -> None:
    """Run as a program."""
    messages, stop = (socket.socket(fileno=int(argument)) for argument in sys.argv[1:3])
    end_with_input()
    os.environ["NICEGUI_STORAGE_PATH"] = str(Path(tempfile.gettempdir(), "memo-web"))  # made only where NiceGUI stores
    channel = Channel(messages)
    settings, _ = channel.receive()
    settings.pop("kind")
    try:
        listening = _listening(settings["address"], settings["port"])
    except OSError as error:
        where = f"{settings['address']}:{settings['port']}"
        remedy = "another port (teacher.port), or end what listens there"
        channel.send("failed", problem=f"{where} cannot be listened at ({error.strerror})", remedy=remedy)
        return
    asyncio.run(_serve(channel, StopLine(stop), listening, settings))


def _listening(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.bind((address, port))
    listening.listen(128)
    return listening


async def _serve(channel: Channel, stop_line: StopLine, listening: socket.socket, settings: dict[str, Any]) -> None:
    import uvicorn

    from memo_web.pages.application import application
    from memo_web.pages.guard import allowed_for
    from memo_web.pages.run_view import RunView

    port = listening.getsockname()[1]
    tls = bool(settings["certificate"])
    allowed = allowed_for(settings["address"], port, settings["names"], settings["proxy"], settings["token"], tls)
    view = RunView(channel, stop_line, asyncio.get_running_loop(), for_study=settings["for_study"])
    config = uvicorn.Config(
        application(view, allowed),
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        ws="websockets-sansio",
        ws_max_size=1_000_000,
        timeout_graceful_shutdown=1,
        ssl_certfile=settings["certificate"] or None,
        ssl_keyfile=settings["key"] or None,
    )
    server = uvicorn.Server(config)
    serving = asyncio.ensure_future(server.serve(sockets=[listening]))
    while not server.started and not serving.done():
        await asyncio.sleep(0.01)
    if serving.done():
        serving.result()
        return
    view.start()
    attending = asyncio.ensure_future(view.attend())
    channel.send("listening", url=_address(settings, port, tls), port=port)
    try:
        await serving
    finally:
        attending.cancel()


def _address(settings: dict[str, Any], port: int, tls: bool) -> str:
    """Address at which a person opens the pages, without the token."""
    if settings["proxy"]:
        return str(settings["proxy"]).rstrip("/") + "/"
    address = (
        settings["address"] if settings["address"] not in ("0.0.0.0", "::") else (settings["names"] or ["localhost"])[0]
    )
    plain = f"[{address}]" if ":" in address else address
    return f"{'https' if tls else 'http'}://{plain}:{port}/"


if __name__ == "__main__":
    main()
