"""A study held in the browser: the command in a process of its own, its operator, and scripted participants."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

START_S = 180.0
WAIT_MS = 120_000
SETTLED_MS = 30_000  # in which an answer reaches the run, on a machine under load
MEMO = (sys.executable, "-c", "from memo_core.cli.main import main; main()", "study")
CONSENT = "Words go to the provider of the language model. You may withdraw at any time."
FILE = """
llm: offline
suite: quirks
run: {{video: "off", pace: "{pace}"}}
study:
  tasks: [{tasks}]
  participants: [{participants}]
  rounds: {rounds}
  session_minutes: {minutes}
  hours: {hours}
  clock: real
  consent: {consent}
"""


class StudyCommand:
    """Runs ``memo study run`` with participants in the browser, and goes on with it after it ended.

    Attributes:
        folder: the study's folder, with journals and books.
        url: where the pages are, always at the same port.
        printed: everything that the commands printed.
    """

    def __init__(
        self,
        folder: Path,
        participants: tuple[str, ...] = ("P01",),
        tasks: tuple[str, ...] = ("open-the-cupboard",),
        rounds: int = 1,
        minutes: float = 30,
        hours: float | None = None,
        pace: str = "off",
    ) -> None:
        port = _free_port()
        consent = folder / "consent.txt"
        consent.write_text(CONSENT)
        people = ", ".join(f"{{id: {one}, teacher: {{backend: web, port: {port}}}}}" for one in participants)
        self._file, self._out = folder / "study.yaml", folder / "out"
        self._file.write_text(
            FILE.format(
                tasks=", ".join(tasks),
                participants=people,
                rounds=rounds,
                minutes=minutes,
                consent=consent,
                hours="null" if hours is None else hours,
                pace=pace,
            )
        )
        self.folder, self.url, self.printed = self._out / "study", f"http://127.0.0.1:{port}/", ""
        self.process: subprocess.Popen[str] | None = None

    def __enter__(self) -> StudyCommand:
        self.start("run", str(self._file), "--out", str(self._out))
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()

    def resume(self) -> None:
        """Go on after the command has ended, or was killed."""
        self.start("resume", str(self._out))

    def start(self, *arguments: str) -> None:
        """Run the command until its pages are there."""
        self._ready = threading.Event()
        self.process = subprocess.Popen(
            [*MEMO, *arguments], text=True, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, args=(self.process,), daemon=True)
        self._reader.start()
        assert self._ready.wait(START_S) and self.operator_address, self.printed

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            self.printed += line
            if "runs the study opens" in line:
                self._ready.set()
        self._ready.set()

    @property
    def operator_address(self) -> str:
        """Address with the operator's key."""
        found = re.findall(r"runs the study opens (\S+)", self.printed)
        return found[-1] if found else ""

    def ended(self, within: float = 120.0) -> int:
        """Wait until the command ends by itself; its exit code."""
        assert self.process is not None
        code = self.process.wait(within)
        self._reader.join(5)
        return code

    def kill(self) -> None:
        """End the command as a power cut does; its server ends with it."""
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def kill_server(self) -> None:
        """Kill the process of the pages."""
        assert self.process is not None
        [server] = [pid for pid in _children(self.process.pid) if b"memo_web.pages.program" in _command_line(pid)]
        os.kill(server, signal.SIGKILL)

    def journal(self) -> list[dict[str, Any]]:
        """Lines of the first history's journal."""
        from memo_core.runlog.json_lines import read_lines

        return [line for _, line in read_lines(self.folder / "history-0" / "journal.jsonl")]


class Visitor:
    """One person's browser, whose cookies last as long as this object."""

    def __init__(self, browser: Any, study: StudyCommand) -> None:
        self.study = study
        self.context = browser.new_context(viewport={"width": 700, "height": 500})
        self.dialogs: list[str] = []
        self.page = self.open_page()

    def open_page(self) -> Any:
        page = self.context.new_page()
        page.set_default_timeout(WAIT_MS)
        page.on("dialog", lambda dialog: (self.dialogs.append(dialog.message), dialog.dismiss()))
        return page

    def enter(self, address: str) -> None:
        """Open an address with a key, and confirm."""
        self.page.goto(address)
        self.page.get_by_role("button", name="Go on").click()
        self.page.wait_for_url(re.compile("/(study|operator)$"))

    def go(self, path: str) -> str:
        """Open a page; what it says."""
        self.page.goto(f"{self.study.url}{path}")
        self.page.wait_for_timeout(1000)
        return self.says()

    def says(self) -> str:
        """The text that the page shows."""
        return str(self.page.inner_text("body"))

    def sees(self, text: str, within_ms: int = WAIT_MS) -> None:
        """Wait until the page shows a text."""
        self.page.get_by_text(text).filter(visible=True).first.wait_for(timeout=within_ms)

    def press(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def fill(self, label: str, text: str) -> None:
        """Fill a field in."""
        self.page.get_by_label(label).fill(text)


class Operator(Visitor):
    """The person who runs the study."""

    def __init__(self, browser: Any, study: StudyCommand) -> None:
        super().__init__(browser, study)
        self.enter(study.operator_address)

    def address_of(self, participant: str) -> str:
        """The address that the operator's page shows for a participant."""
        if not self.page.url.endswith("/operator"):
            self.page.goto(f"{self.study.url}operator")
        link = self.page.locator(f"a[data-participant={participant}]")
        return str(link.get_attribute("href"))


class Participant(Visitor):
    """A scripted participant.

    Attributes:
        said: all words sent, in order.
    """

    def __init__(self, browser: Any, study: StudyCommand, address: str) -> None:
        super().__init__(browser, study)
        self.said: list[str] = []
        self.enter(address)

    def close_and_come_back(self) -> None:
        """Close the page, and open the session again in the same browser."""
        self.page.close()
        self.page = self.open_page()
        self.page.goto(f"{self.study.url}study")

    def agree(self) -> None:
        self.sees(CONSENT)
        self.press("I agree")

    def introduce(self, age: str = "30", gender: str = "f", robots: str = "none", models: str = "daily") -> None:
        self.sees("Each answer is optional")
        for label, text in (
            ("Your age in years", age),
            ("Your gender", gender),
            ("Your experience with robots", robots),
            ("Your experience with language models", models),
        ):
            self.fill(label, text)
        self.press("Go on")

    def asked(self, within_ms: int = WAIT_MS) -> str:
        """Wait for a question; its title."""
        return str(self.page.get_by_test_id("asked").inner_text(timeout=within_ms))

    def answer(self, choice: str = "", words: str = "") -> None:
        """Answer the open question by a button, or in words, and wait until it is gone. A page that was just loading
        itself anew lost the answer: it is given again, as a person would."""
        self.asked()
        before = self._number()
        if not choice:
            self.said.append(words)
        while self._number() in (before, None) and not self.is_over():
            if self._number() == before:
                self._holds(lambda: self._send(choice, words))
            self._holds(lambda: self._settled(before))

    def _send(self, choice: str, words: str) -> bool:
        if words:
            self.page.get_by_test_id("words").fill(words)
        button = self.page.locator(f"[data-choice={choice}]") if choice else self.page.get_by_test_id("send")
        button.click(timeout=SETTLED_MS)
        return True

    def _settled(self, before: str) -> bool:
        """Wait a while for another question, or for none."""
        look = "before => document.querySelector('[data-testid=question]')?.dataset.asked !== before"
        self.page.wait_for_function(look, arg=before, timeout=SETTLED_MS)
        return True

    def _number(self) -> str | None:
        """Number of the open question, "0" if there is none; None while the page is not there."""
        found: list[str | None] = [None]
        look = "() => document.querySelector('[data-testid=question]')?.dataset.asked ?? null"
        self._holds(lambda: found.__setitem__(0, self.page.evaluate(look)) is None)
        return found[0]

    def is_over(self) -> bool:
        """Whether the session is over, or the command has ended."""
        ended = self.study.process is None or self.study.process.poll() is not None
        return ended or self._holds(lambda: self.page.get_by_text("That was your session").count() > 0)

    def approve_the_rest(self) -> None:
        """Approve whatever is asked until the session is over, or the command has ended."""
        while not self.is_over():
            if self._holds(lambda: self.page.get_by_test_id("asked").count() > 0):
                self._holds(lambda: self.answer("approve") is None)
            self.page.wait_for_timeout(200)

    def teach(self, words: Callable[[int], str]) -> None:
        """Answer the open question, if there is one: a first attempt is corrected, everything else approved."""
        self.page.wait_for_timeout(500)
        if not self._holds(lambda: self.page.get_by_test_id("asked").count() > 0):
            return
        title = self.asked()
        if title == "I noted:":
            self.answer("accept")
        elif "attempt 1." in title:
            self.answer(words=words(len(self.said) + 1))
        elif "could not learn" in title:
            self.answer("accept")
        else:
            self.answer("approve")

    def until(self, condition: Callable[[], bool], within_s: float = WAIT_MS / 1000) -> None:
        """Wait for a condition."""
        over = time.monotonic() + within_s
        while not self._holds(condition):
            assert time.monotonic() < over, self.says()
            self.page.wait_for_timeout(100)

    def _holds(self, condition: Callable[[], bool]) -> bool:
        from playwright.sync_api import Error

        try:
            return condition()
        except Error:  # the page is being loaded anew
            return False

    @contextmanager
    def loaded_anew(self) -> Iterator[None]:
        """Wait after the block until the page has loaded itself anew."""
        self.page.evaluate("() => { window.before = true }")
        yield
        self.until(
            lambda: self.page.evaluate("() => window.before === undefined && document.readyState === 'complete'")
        )


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def _children(pid: int) -> list[int]:
    """Processes whose parent is ``pid``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
            if parent == pid:
                found.append(int(entry.name))
    return found


def _command_line(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()
