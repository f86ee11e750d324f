"""The server's process: it is started again, it is reached as its settings say, and nothing delays the stop."""

from __future__ import annotations

import os
import queue
import signal
import ssl
import subprocess
import threading
import time

import httpx
import pytest
from memo_web.robot_side.listening import pages_hear
from memo_web.robot_side.pages_process import PagesProcess
from memo_web.settings import WebSettings
from websockets.exceptions import InvalidHandshake
from websockets.sync.client import connect

from memo_core.plugin import BackendUnavailable, FeedbackGiven

pytestmark = [pytest.mark.process, pytest.mark.wire]

TOKEN = "a-token-of-some-length"
WAIT_S = 30.0
SOCKET = "_nicegui_ws/socket.io/?EIO=4&transport=websocket"


@pytest.fixture(scope="module")
def pages():
    pages = PagesProcess(WebSettings(port=0))
    pages.start()
    yield pages
    pages.close()


def test_a_page_comes_from_this_server_alone(pages):
    answer = httpx.get(f"{pages.url}teach")
    assert answer.status_code == 200 and "memo_visitor" in answer.cookies
    for line in answer.text.splitlines():
        assert "src=" not in line or "http" not in line.split("src=")[1], line


def test_the_server_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    pages = PagesProcess(WebSettings(port=0))
    pages.start()
    httpx.get(f"{pages.url}teach")
    pages.close()
    assert not list(tmp_path.iterdir())


def test_the_stop_arrives(pages):
    presses: queue.Queue[str] = queue.Queue()
    pages.stop_pressed = presses.put
    origin = {"Origin": pages.url.rstrip("/")}
    assert httpx.post(f"{pages.url}stop", headers=origin, json={"press": "1"}).json() == {"state": "stopping"}
    assert presses.get(timeout=WAIT_S) == "1"
    httpx.post(f"{pages.url}stop", headers=origin, json={"press": "1"})  # the same press by another way
    httpx.post(f"{pages.url}stop", headers=origin, json={"press": "2"})
    assert presses.get(timeout=WAIT_S) == "2"
    pages.say_stop("clear")


@pytest.mark.parametrize("body", ["[]", "{}", '{"press": {"a": 1}}', '{"press": "\\ud800\\n stop"}'])
def test_an_odd_press_is_a_press(pages, body):
    presses: queue.Queue[str] = queue.Queue()
    pages.stop_pressed = presses.put
    headers = {"Origin": pages.url.rstrip("/"), "Content-Type": "application/json"}
    assert httpx.post(f"{pages.url}stop", headers=headers, content=body).status_code == 200
    assert presses.get(timeout=WAIT_S).isalnum()


def test_getting_does_not_stop_and_neither_does_another_site(pages):
    presses: queue.Queue[str] = queue.Queue()
    pages.stop_pressed = presses.put
    assert httpx.get(f"{pages.url}stop").status_code != 200
    for headers in ({}, {"Origin": "http://evil.example"}, {"Host": "evil.example", "Origin": "http://evil.example"}):
        assert httpx.post(f"{pages.url}stop", headers=headers, json={"press": "3"}).status_code == 403
    assert presses.empty()


def test_a_websocket_of_another_site_is_refused(pages):
    url = pages.url.replace("http:", "ws:") + SOCKET
    with connect(url, origin=pages.url.rstrip("/")):
        pass
    for origin in (None, "http://evil.example"):
        with pytest.raises(InvalidHandshake):
            connect(url, origin=origin)


def test_messages_do_not_delay_the_stop(pages):
    """While the channel is full of pictures, a press is there at once."""
    came: queue.Queue[float] = queue.Queue()
    pages.stop_pressed = lambda press: came.put(time.monotonic())
    ended = threading.Event()

    def flood():
        while not ended.is_set():
            pages.send("picture", bytes(400_000), droppable=True, camera="front")
            time.sleep(0.002)

    threading.Thread(target=flood, daemon=True).start()
    took = []
    with httpx.Client(headers={"Origin": pages.url.rstrip("/")}) as client:
        for number in range(10):
            pressed = time.monotonic()
            client.post(f"{pages.url}stop", json={"press": f"flood{number}"})
            took.append(came.get(timeout=WAIT_S) - pressed)
    ended.set()
    assert sorted(took)[5] < 1.0  # the queue behind the flood takes many seconds; how long it takes idle: memo bench


def test_a_server_that_was_killed_is_started_again_and_knows_what_it_must(pages):
    pages.send("offers", keep="offers", offers={"tasks": [], "task": "", "seed": 0, "why_not": "not from here"})
    before, url = pages._connection, pages.url
    os.killpg(before._process.pid, signal.SIGKILL)
    until = time.monotonic() + WAIT_S
    while pages._connection in (before, None):
        assert time.monotonic() < until
        time.sleep(0.05)
    assert pages.url == url
    assert httpx.get(f"{url}teach").status_code == 200
    assert not pages.lost


def test_a_port_that_is_taken_is_said(pages):
    taken = int(pages.url.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(BackendUnavailable, match=f"127.0.0.1:{taken} cannot be listened at"):
        PagesProcess(WebSettings(port=taken)).start()


def test_it_ends_with_its_pages(pages):
    another = PagesProcess(WebSettings(port=0))
    another.start()
    process = another._connection._process
    another.close()
    assert process.poll() is not None
    pages_hear(FeedbackGiven(1, "Kim", "OPEN(microwave)", "half a character: \ud800"))  # still to the other one
    assert httpx.get(f"{pages.url}teach").status_code == 200


def test_with_tls_and_a_token(tmp_path, monkeypatch):
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=localhost"
    more = ["-addext", "subjectAltName=DNS:localhost", "-keyout", str(key), "-out", str(certificate)]
    try:
        subprocess.run([*command.split(), *more], check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("there is no openssl here")
    monkeypatch.setenv("MEMO_WEB_TOKEN", TOKEN)
    settings = WebSettings(address="0.0.0.0", port=0, tls_certificate=str(certificate), tls_key=str(key))
    pages = PagesProcess(settings)
    pages.start()
    try:
        presses: queue.Queue[str] = queue.Queue()
        pages.stop_pressed = presses.put
        assert pages.url.startswith("https://localhost:")
        origin = {"Origin": pages.url.rstrip("/")}
        trust = ssl.create_default_context(cafile=str(certificate))
        with httpx.Client(verify=trust) as client:
            assert client.get(f"{pages.url}teach").status_code == 403
            assert client.post(f"{pages.url}stop", headers=origin, json={"press": "1"}).status_code == 403
            assert client.get(f"{pages.url}teach?token={TOKEN}", follow_redirects=True).status_code == 200
            assert client.post(f"{pages.url}stop", headers=origin, json={"press": "2"}).status_code == 200
            assert presses.get(timeout=WAIT_S) == "2"
            cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        url = pages.url.replace("https:", "wss:") + SOCKET
        with pytest.raises(InvalidHandshake):
            connect(url, origin=origin["Origin"], ssl=trust)
        with connect(url, origin=origin["Origin"], ssl=trust, additional_headers={"Cookie": cookies}):
            pass
        with pytest.raises(httpx.HTTPError):
            httpx.get(pages.url.replace("https:", "http:"))
    finally:
        pages.close()


def test_a_server_for_a_study_shows_nothing_before_it_knows_who_is_who():
    pages = PagesProcess(WebSettings(port=0), for_study=True)
    pages.start()
    try:
        for path in ("", "teach", "why", "picture/front", "operator"):
            refused = httpx.get(f"{pages.url}{path}")
            assert refused.status_code == 503 and "being prepared" in refused.text, path
        known = {"folder": "", "keys": {}, "roles": {}, "phase": "waiting", "participant": "", "session_over": []}
        pages.send("study", keep="study", study=known | {"owner": None, "token": ""})
        deadline = time.monotonic() + WAIT_S
        while (shown := httpx.get(f"{pages.url}why", timeout=WAIT_S)).status_code == 503:
            assert time.monotonic() < deadline
        assert "for the person who runs the study" in shown.text
    finally:
        pages.close()
