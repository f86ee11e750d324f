"""Access control: one check in front of every request and websocket.

* The name in ``Host`` must be one of this server's, so that no page elsewhere reaches it by a name of its own.
* Nothing acts by GET. POST and websockets must come from a page of this server (``Origin``).
* Where a token is wanted, it is brought once in the address and then kept in a cookie.
* Every visitor has a random identity in a cookie that scripts cannot read.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import attrs
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

VISITOR_COOKIE, TOKEN_COOKIE = "memo_visitor", "memo_token"
_IDENTITY = 22  # characters of 128 random bits
_READING = ("GET", "HEAD")
_LARGEST_BODY = 64_000  # bytes of a POST
_HEADERS = {
    # NiceGUI compiles its templates in the browser, hence 'unsafe-eval'; nothing comes from another server.
    "Content-Security-Policy": "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; "
    "worker-src 'self' blob:; object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


@attrs.frozen
class Allowed:
    """Names, origins and token that the guard lets in.

    Attributes:
        hosts: names with port, as in ``Host``, that are this server's; lower case.
        origins: origins of this server's pages.
        token: what a visitor must bring; empty: nothing.
        secure: whether browsers reach this server by TLS only, and cookies may say so.
    """

    hosts: frozenset[str]
    origins: frozenset[str]
    token: str = ""
    secure: bool = False


class Guard:
    """ASGI application in front of another one."""

    def __init__(self, app: ASGIApp, allowed: Allowed) -> None:
        """Put a check in front of an application.

        Args:
            app: the application.
            allowed: what is let in.
        """
        self._app = app
        self._allowed = allowed
        self._admitted = hashlib.sha256(b"memo-web" + allowed.token.encode()).hexdigest()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await self._refuse(scope, receive, send, refusal)
            return
        cookies = _cookies(headers)
        known = cookies.get(VISITOR_COOKIE, "")
        visitor = known if _is_identity(known) else secrets.token_urlsafe(16)
        scope.setdefault("state", {})["visitor"] = visitor
        new = {} if visitor == known else {VISITOR_COOKIE: visitor}
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
            return
        if self._allowed.token and not self._has_token(cookies):
            assert scope["type"] == "http"  # a websocket without it was refused
            await self._ask_token(scope, receive, send)
            return
        await self._app(scope, _limited(receive), self._adding(send, new))

    # -- refusing ------------------------------------------------------------------------------------------------------
    def _refusal(self, scope: Scope, headers: Headers) -> str | None:
        """Why a request is refused; None if it is not."""
        if headers.get("host", "").lower() not in self._allowed.hosts:
            return "this server does not go by that name (names, proxy)"
        origin = headers.get("origin")
        acts = scope["type"] == "websocket" or scope["method"] not in _READING
        if origin is None and acts:
            return "without an origin nothing is done"
        if origin is not None and origin.lower() not in self._allowed.origins:
            return "this comes from another site"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length[:20]) > _LARGEST_BODY:
            return "this is too long, or does not say how long it is"
        if acts and self._allowed.token and not self._has_token(_cookies(headers)):
            return "the token is missing"
        return None

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, why: str) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": why})
            return
        await PlainTextResponse(f"memo: {why}\n", 403)(scope, receive, self._adding(send, {}))

    # -- the token -----------------------------------------------------------------------------------------------------
    def _has_token(self, cookies: dict[str, str]) -> bool:
        return hmac.compare_digest(cookies.get(TOKEN_COOKIE, "").encode(), self._admitted.encode())

    async def _ask_token(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take the token out of the address into a cookie, or say that it is missing."""
        brought = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[-1]
        if not hmac.compare_digest(brought.encode("utf-8", "replace"), self._allowed.token.encode()):
            refusal: Response = PlainTextResponse("memo: the token is missing; open the address with ?token=…\n", 403)
            await refusal(scope, receive, self._adding(send, {}))
            return
        path = "/" + scope["path"].lstrip("/\\")  # of this server, whatever it begins with
        kept = {TOKEN_COOKIE: self._admitted, VISITOR_COOKIE: scope["state"]["visitor"]}
        await RedirectResponse(path, 303)(scope, receive, self._adding(send, kept))

    def _adding(self, send: Send, cookies: dict[str, str]) -> Send:
        """``send`` with the headers of every answer, and these cookies."""

        async def adding(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers[name] = value
                for name, value in cookies.items():
                    secure = "; Secure" if self._allowed.secure else ""
                    # Lax: a link from elsewhere opens a page as the same visitor; what acts is checked by origin.
                    headers.append("Set-Cookie", f"{name}={value}; Path=/; HttpOnly; SameSite=Lax{secure}")
            await send(message)

        return adding


def _cookies(headers: Headers) -> dict[str, str]:
    jar: SimpleCookie = SimpleCookie()
    for text in headers.getlist("cookie"):
        try:
            jar.load(text)
        except CookieError:
            continue
    return {name: morsel.value for name, morsel in jar.items()}


def _is_identity(text: str) -> bool:
    return len(text) == _IDENTITY and text.isascii() and text.replace("-", "a").replace("_", "a").isalnum()


def _limited(receive: Receive) -> Receive:
    """``receive`` that ends a body which is longer than its header says it may be."""
    taken = 0

    async def limited() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > _LARGEST_BODY:
            return {"type": "http.disconnect"}
        return message

    return limited


def allowed_for(address: str, port: int, names: list[str], proxy: str, token: str, tls: bool) -> Allowed:
    """Names, origins and token that the guard of a server lets in.

    Args:
        address: address that it listens at.
        port: its port.
        names: further names under which browsers reach it.
        proxy: origin under which a proxy shows it; empty: none does.
        token: what a visitor must bring; empty: nothing.
        tls: whether it does TLS itself.

    Returns:
        Names, origins and the token.
    """
    if proxy:
        parts = urlsplit(proxy)
        return Allowed(frozenset({parts.netloc.lower()}), frozenset({f"https://{parts.netloc.lower()}"}), token, True)
    own = {address} - {"0.0.0.0", "::"}
    scheme, usual = ("https", 443) if tls else ("http", 80)
    hosts: set[str] = set()
    for name in {*own, "127.0.0.1", "localhost", "[::1]", *names}:
        plain = f"[{name}]" if ":" in name and not name.startswith("[") else name
        hosts |= {f"{plain}:{port}".lower()} | ({plain.lower()} if port == usual else set())
    return Allowed(frozenset(hosts), frozenset(f"{scheme}://{host}" for host in hosts), token, tls)


def visitor_of(request: Any) -> str:
    """Identity of the visitor who made a request.

    Args:
        request: Starlette's request.

    Returns:
        22 characters, the same for all pages that one browser opens.
    """
    return str(request.state.visitor)
