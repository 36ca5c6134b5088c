"""Headless Chromium for tests, by the DevTools protocol over a pair of pipes; no driver, no port.

    with closing(Chrome()) as chrome:
        page = chrome.open("http://127.0.0.1:8765/")
        page.until("document.body.dataset.state === 'live'")
        page.press("t"); page.evaluate("...")
        page.requests, page.sockets, page.errors

Rules
- One thread reads the browser's messages; waiting is on a condition.
- The browser starts with an empty profile, and makes no connections of its own: its background services are
  switched off, and names other than this machine's are not resolved.
"""

import json
import os
import shutil
import subprocess
import tempfile
import threading
from typing import Any

from tests.support.waiting import SOON_S

START_S = 60.0  # a cold start on a slow disk
#: Seen from outside, a phone: 390x844 px at 3 dots a pixel is the commonest of the last years.
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-extensions", "--disable-default-apps", "--disable-domain-reliability",
    "--disable-features=OptimizationHints,MediaRouter,DialMediaRouteProvider,Translate",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
    "--metrics-recording-only", "--mute-audio", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip


def chromium() -> str | None:
    """The browser's path; None: not installed."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Chrome:
    """A running browser."""

    def __init__(self) -> None:
        path = chromium()
        assert path is not None, "no Chromium here"
        self._profile = tempfile.TemporaryDirectory(prefix="chrome-", ignore_cleanup_errors=True)
        theirs_in, self._write = os.pipe()
        self._read, theirs_out = os.pipe()
        self._process = subprocess.Popen(
            # The browser reads descriptor 3 and writes 4, whatever numbers ours have (a plain sh takes only
            # those of one digit).
            [
                *("bash", "-c", f'exec "$0" "$@" 3<&{theirs_in} 4>&{theirs_out}', path, *FLAGS),
                *(f"--user-data-dir={self._profile.name}", "about:blank"),
            ],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._changed = threading.Condition()
        self._answers: dict[int, dict[str, Any]] = {}
        self._pages: dict[str, Page] = {}
        self._next = 0
        self._ended = False
        self._reader = threading.Thread(target=self._run, daemon=True)
        self._reader.start()
        self.call("Browser.getVersion", timeout_s=START_S)

    def open(self, url: str, phone: bool = False) -> "Page":
        """A new page, loading `url`."""
        target = self.call("Target.createTarget", {"url": "about:blank"})["targetId"]
        session = self.call("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        page = self._pages[session] = Page(self, session, target)
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        metrics = PHONE if phone else {"width": 1280, "height": 800, "deviceScaleFactor": 1}
        page.call("Emulation.setDeviceMetricsOverride", {"mobile": False, **metrics})
        page.call("Emulation.setTouchEmulationEnabled", {"enabled": phone})
        page.call("Page.navigate", {"url": url})
        return page

    def call(
        self, method: str, params: Any = None, session: str | None = None, timeout_s: float = SOON_S
    ) -> Any:
        """Send a command to the browser and wait for its answer."""
        with self._changed:
            self._next += 1
            number = self._next
        message = {"id": number, "method": method, "params": params or {}}
        if session is not None:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._write, data) :]
        with self._changed:
            self._changed.wait_for(lambda: number in self._answers or self._ended, timeout_s)
            assert number in self._answers, f"{method}: no answer within {timeout_s:g} s"
            answer = self._answers.pop(number)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def _run(self) -> None:
        waiting = b""
        while data := os.read(self._read, 1 << 16):
            *whole, waiting = (waiting + data).split(b"\0")
            for text in whole:
                message = json.loads(text)
                with self._changed:
                    if "id" in message:
                        self._answers[message["id"]] = message
                    elif (page := self._pages.get(message.get("sessionId", ""))) is not None:
                        page.take(message["method"], message["params"])
                    self._changed.notify_all()
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def close(self) -> None:
        """End the browser and delete its profile."""
        self._process.terminate()
        try:
            self._process.wait(SOON_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(SOON_S)
        self._reader.join(SOON_S)
        os.close(self._read)
        os.close(self._write)
        self._profile.cleanup()


class Page:
    """One tab.

    requests  addresses of everything it asked for
    sockets   addresses of the sockets that it opened
    errors    exceptions and error lines of its console
    """

    def __init__(self, chrome: Chrome, session: str, target: str) -> None:
        self._chrome, self._session, self._target = chrome, session, target
        self.requests: list[str] = []
        self.sockets: list[str] = []
        self.errors: list[str] = []

    def take(self, method: str, params: Any) -> None:
        """An event."""
        if method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.sockets.append(params["url"])
        elif method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")

    def call(self, method: str, params: Any = None, timeout_s: float = SOON_S) -> Any:
        return self._chrome.call(method, params, self._session, timeout_s)

    def evaluate(self, script: str, timeout_s: float = SOON_S) -> Any:
        """Value of an expression in the page; a promise is waited for."""
        given = {"expression": script, "awaitPromise": True, "returnByValue": True}
        answer = self.call("Runtime.evaluate", given, timeout_s)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, condition: str, timeout_s: float = SOON_S) -> None:
        """Wait until an expression holds; tested with every picture that the page draws."""
        wait = (
            f"new Promise(done => {{ const end = Date.now() + {timeout_s * 1e3};"
            f"const look = () => {{ let ok = false; try {{ ok = {condition} }} catch {{}}"
            "if (ok || Date.now() > end) done(Boolean(ok)); else setTimeout(look, 20) }; look() })"
        )
        held = self.evaluate(wait, timeout_s + 5)
        assert held, f"never within {timeout_s:g} s: {condition}; {self.about()}"

    def about(self) -> str:
        """The visible text."""
        return f"errors {self.errors}; page says: " + str(self.evaluate("document.body.innerText"))[:600]

    def press(self, key: str) -> None:
        """A key, as from a keyboard."""
        for kind in ("keyDown", "keyUp"):
            text = key if kind == "keyDown" and len(key) == 1 else ""
            self.call("Input.dispatchKeyEvent", {"type": kind, "key": key, "text": text})

    def click(self, selector: str) -> None:
        """A click in the middle of an element."""
        x, y = self.evaluate(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView();"
            "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2] })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call(
                "Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
            )

    def close(self) -> None:
        self._chrome.call("Target.closeTarget", {"targetId": self._target})
