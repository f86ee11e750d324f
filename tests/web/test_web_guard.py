"""The guard lets in this server's own pages only: by name, origin and token; every visitor has an identity."""

from __future__ import annotations

import asyncio

import pytest
from memo_web.pages.guard import Guard, allowed_for, visitor_of

TOKEN = "a-token-of-some-length"
OWN = {"host": "127.0.0.1:8710"}
FROM_OWN_PAGE = OWN | {"origin": "http://127.0.0.1:8710"}


class Application:
    """An application behind the guard that notes who gets in."""

    def __init__(self):
        self.visitors = []

    async def __call__(self, scope, receive, send):
        self.visitors.append(scope["state"]["visitor"])
        if scope["type"] == "http":
            body = b""
            while (message := await receive())["type"] == "http.request":
                body += message.get("body", b"")
                if not message.get("more_body"):
                    break
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": str(len(body)).encode()})
        else:
            await send({"type": "websocket.accept"})


class Answer:
    def __init__(self, sent):
        self.sent = sent
        self.status = sent[0].get("status")
        self.headers = [(name.decode().lower(), value.decode()) for name, value in sent[0].get("headers", ())]

    def all(self, name):
        return [value for each, value in self.headers if each == name]

    @property
    def cookies(self):
        return dict(one.split(";")[0].split("=", 1) for one in self.all("set-cookie"))


def guarded(token="", proxy="", tls=False, address="127.0.0.1", names=()):
    application = Application()
    return Guard(application, allowed_for(address, 8710, list(names), proxy, token, tls)), application


def request(guard, method="GET", headers=OWN, path="/teach", query="", kind="http", body=(b"",)):
    """One request; the answer with its headers."""
    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(name.encode(), value.encode("latin-1")) for name, value in headers.items()],
        **({"method": method} if kind == "http" else {}),
    }
    sent = []
    parts = [{"type": "http.request", "body": one, "more_body": n + 1 < len(body)} for n, one in enumerate(body)]
    incoming = iter(parts if kind == "http" else [{"type": "websocket.connect"}])

    async def receive():
        return next(incoming)

    async def send(message):
        sent.append(message)

    asyncio.run(guard(scope, receive, send))
    return Answer(sent)


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8710", "127.0.0.1:80", "127.0.0.1.evil.example:8710", ""]
)
def test_a_name_that_is_not_this_servers_is_refused(host):
    guard, behind = guarded()
    assert request(guard, headers={"host": host}).status == 403
    assert not behind.visitors


@pytest.mark.parametrize("host", ["127.0.0.1:8710", "localhost:8710", "LOCALHOST:8710", "[::1]:8710"])
def test_this_machines_own_names_are_let_in(host):
    assert request(guarded()[0], headers={"host": host}).status == 200


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://127.0.0.1:8710",
        "http://127.0.0.1:9999",
        "null",
        "http://127.0.0.1:8710.evil.example",
    ],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_another_origin_is_refused(origin, kind):
    guard, behind = guarded()
    answer = request(guard, "POST", OWN | {"origin": origin}, kind=kind)
    assert answer.status == 403 or answer.sent[0]["type"] == "websocket.close"
    assert not behind.visitors


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_what_acts_must_say_where_it_comes_from(kind):
    guard, behind = guarded()
    request(guard, "POST", OWN, kind=kind)
    assert not behind.visitors
    request(guard, "POST", FROM_OWN_PAGE, kind=kind)
    assert len(behind.visitors) == 1


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_other_methods_are_taken_for_acting(method):
    guard, behind = guarded()
    assert request(guard, method, OWN).status == 403
    assert not behind.visitors


def test_without_the_token_nothing_is_reached():
    guard, behind = guarded(TOKEN)
    assert request(guard).status == 403
    assert request(guard, query="token=wrong").status == 403
    assert request(guard, query="token=").status == 403
    assert request(guard, "POST", FROM_OWN_PAGE, "/stop").status == 403
    assert request(guard, headers=FROM_OWN_PAGE, kind="websocket").sent[0]["type"] == "websocket.close"
    assert request(guard, headers=OWN | {"cookie": f"memo_token={TOKEN}"}).status == 403  # it is not the token itself
    assert not behind.visitors


def test_the_token_moves_from_the_address_into_a_cookie():
    guard, behind = guarded(TOKEN, tls=True)
    own = {"host": "127.0.0.1:8710", "origin": "https://127.0.0.1:8710"}
    answer = request(guard, headers=OWN, query=f"token={TOKEN}")
    assert answer.status == 303 and answer.all("location") == ["/teach"]
    assert TOKEN not in str(answer.sent)
    assert all("HttpOnly" in one and "SameSite=Lax" in one and "Secure" in one for one in answer.all("set-cookie"))
    cookies = "; ".join(f"{name}={value}" for name, value in answer.cookies.items())
    assert request(guard, headers=OWN | {"cookie": cookies}).status == 200
    assert request(guard, "POST", own | {"cookie": cookies}, "/stop").status == 200
    request(guard, headers=own | {"cookie": cookies}, kind="websocket")
    assert behind.visitors == [answer.cookies["memo_visitor"]] * 3


@pytest.mark.parametrize("path", ["//evil.example/", "/\\evil.example", "///evil.example"])
def test_the_token_leads_to_no_other_site(path):
    answer = request(guarded(TOKEN)[0], path=path, query=f"token={TOKEN}")
    assert answer.all("location")[0].startswith("/e")


def test_a_visitor_keeps_an_identity_that_cannot_be_guessed_or_chosen_freely():
    guard, behind = guarded()
    first = request(guard).cookies["memo_visitor"]
    second = request(guard).cookies["memo_visitor"]
    assert first != second and len(first) == 22
    assert not request(guard, headers=OWN | {"cookie": f"memo_visitor={first}"}).cookies
    for odd in ("P01", "x" * 23, "<script>alert(1)</scr>", "'; DROP TABLE people;-"):
        request(guard, headers=OWN | {"cookie": f"memo_visitor={odd}"})
        assert odd not in behind.visitors


def test_a_long_body_is_cut_off():
    guard, _ = guarded()
    assert request(guard, "POST", FROM_OWN_PAGE | {"content-length": "1000000"}).status == 403
    answer = request(guard, "POST", FROM_OWN_PAGE, body=[b"x" * 30_000] * 10)  # without a length that says so
    assert int(answer.sent[1]["body"]) <= 64_000


def test_a_length_that_is_no_number_is_refused():
    assert request(guarded()[0], "POST", FROM_OWN_PAGE | {"content-length": "many"}).status == 403


def test_answers_forbid_other_sites_in_both_directions():
    headers = dict(request(guarded()[0]).headers)
    policy = headers["content-security-policy"]
    assert "frame-ancestors 'none'" in policy and "default-src 'self'" in policy
    assert "http:" not in policy and "https:" not in policy and "*" not in policy
    assert headers["x-content-type-options"] == "nosniff" and headers["referrer-policy"] == "no-referrer"


def test_behind_a_proxy_only_its_name_counts():
    guard, behind = guarded(TOKEN, proxy="https://robots.example", address="0.0.0.0")
    assert request(guard, headers=OWN, query=f"token={TOKEN}").status == 403
    assert request(guard, headers={"host": "robots.example"}, query=f"token={TOKEN}").status == 303
    assert not behind.visitors


def test_the_identity_is_found_on_a_request():
    from starlette.requests import Request

    assert visitor_of(Request({"type": "http", "state": {"visitor": "me"}})) == "me"
