"""The host's page in a real browser: several fingers as a hand, from frames on a bus."""

import math
import os
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest

import hostlink
from hostlink.view import HandView
from hostlink.web import parse_listen
from hostlink.wire import Contact, State, Status
from tests.browser.chrome import Chrome, Page
from tests.hostlink.test_client import make_node
from tests.support.waiting import SOON_S

BUS = f"udp:239.0.0.8?port={21_000 + os.getpid() % 20_000}"
TOKEN = "a-token-for-tests"
FINGERS = (1, 2, 3, 5)  # the ring finger is missing


class Hand:
    """Fingers that send, each pressed by its number in tenths of a millimetre or more.

    moving  instead pressed and released repeatedly, one after the other
    """

    def __init__(self, moving: bool = False, fingers: tuple[int, ...] = FINGERS, bus: str = BUS) -> None:
        self._sample = moving_sample if moving else sample
        pairs = {n: make_node(f"{bus}&node={n}") for n in fingers}
        self.nodes = {n: node for n, (node, _) in pairs.items()}
        self.applications = {n: application for n, (_, application) in pairs.items()}
        self.running = threading.Event()
        self.running.set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        k = 0
        while not self._stop.wait(0.01):
            k += 1
            for n, node in self.nodes.items():
                if self.running.is_set():
                    node.send(self._sample(n, k))

    def close(self) -> None:
        self._stop.set()
        self._thread.join(SOON_S)
        for node in self.nodes.values():
            node.close()


def sample(n: int, k: int) -> State:
    contacts = (Contact(-4.0, 3.0, 1.0), Contact(5.0, -2.0, 0.5))[: 2 if n == 3 else 1]
    return State(
        sample=k,
        status=Status.TOUCHED,
        capture_time_us=time.monotonic_ns() // 1000 - 3000,
        latency_us=3000.0,
        displacement_mm=1 + n / 10,
        force_n=n / 2,
        shear_x_mm=0.3,
        shear_y_mm=0.4,
        contact_n=len(contacts),
        contacts=contacts,
    )


def moving_sample(n: int, k: int) -> State:
    t = k / 100
    depth = max(0.0, 2.4 * math.sin(1.4 * t - 0.9 * n))
    turn = 0.8 * t + n
    place = Contact(3.0 * math.cos(turn), 4.0 * math.sin(turn), depth / 2)
    return replace(
        sample(n, k),
        status=Status.TOUCHED if depth else Status(0),
        displacement_mm=depth,
        force_n=0.6 * depth,
        shear_x_mm=0.4 * depth * math.cos(turn),
        shear_y_mm=0.3 * depth * math.sin(turn),
        torsion_deg=4 * depth * math.sin(t),
        orientation_deg=30.0 if n == 2 and depth else math.nan,
        contact_n=int(depth > 0),
        contacts=(place,) if depth else (),
    )


@pytest.fixture(scope="module")
def hand() -> Iterator[Hand]:
    made = Hand()
    yield made
    made.close()


@pytest.fixture
def page(hand: Hand, chrome: Chrome) -> Iterator[Page]:
    with hostlink.connect(BUS) as connection:
        view = HandView(connection, parse_listen("127.0.0.1:0", TOKEN))
        view.start()
        opened = chrome.open(view.server.url)
        opened.until("document.body.dataset.state === 'live'")
        opened.until("document.querySelectorAll('.finger canvas').length === 4")
        yield opened
        assert opened.errors == []
        opened.close()
        view.close()


def test_fingers_lie_as_a_hand(page: Page) -> None:
    cards = page.evaluate(
        "[...document.querySelectorAll('.finger')].map(c => { const r = c.getBoundingClientRect();"
        "return [c.innerText.split(/\\s+/).slice(0, 2).join(' '), r.left, r.top] })"
    )
    assert [words for words, _, _ in cards] == ["thumb 1", "index 2", "middle 3", "ring 4", "little 5"]
    lefts = [left for _, left, _ in cards]
    assert lefts == sorted(lefts)
    tops = [top for _, _, top in cards]
    assert tops[0] == max(tops), "the thumb lies lowest"
    assert tops[2] == min(tops), "the middle finger reaches farthest"
    assert "not heard" in page.evaluate("document.querySelectorAll('.finger')[3].innerText")


def test_one_finger_has_its_charts_beside_it_on_one_screen(chrome: Chrome) -> None:
    bus = f"udp:239.0.0.8?port={41_000 + os.getpid() % 20_000}"  # the other tests use its port
    with ExitStack() as stack:
        stack.callback(Hand(fingers=(2,), bus=bus).close)
        connection = stack.enter_context(hostlink.connect(bus))
        view = HandView(connection, parse_listen("127.0.0.1:0", TOKEN))
        view.start()
        stack.callback(view.close)
        page = chrome.open(view.server.url)
        stack.callback(page.close)
        page.until("document.querySelectorAll('.finger canvas').length === 1")
        # A force has its chart with its first value.
        page.until("document.querySelectorAll('.chart:not([hidden])').length === 6")
        finger, *charts = page.evaluate(
            "[...document.querySelectorAll('.finger, .chart:not([hidden])')].map(e => {"
            "const r = e.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom] })"
        )
        assert len(charts) == 6
        assert all(left > finger[2] for left, *_ in charts)
        assert max(bottom for *_, bottom in (finger, *charts)) <= page.evaluate("innerHeight")
        assert page.evaluate("document.getElementById('next').disabled")
        assert page.errors == []


def test_an_optional_chart_is_shown_once_it_has_a_value(page: Page) -> None:
    script = (
        "import('./kit.js').then(({ Chart }) => { const box = document.createElement('section');"
        "box.className = 'chart'; box.append(document.createElement('canvas')); document.body.append(box);"
        "const chart = new Chart(box.firstChild, { optional: true }); const hidden = [];"
        "for (const [k, value] of [null, 0.5, null].entries()) {"
        "chart.add(k, [value]); chart.draw(k); hidden.push(box.hidden) }"
        "box.remove(); return hidden })"
    )
    assert page.evaluate(script) == [True, False, False]


def test_no_shear_is_no_arrow(page: Page) -> None:
    """Counts the black pixels of a separate drawing."""
    ink = (
        "import('./kit.js').then(({ arrow }) => { const c = document.createElement('canvas');"
        "const g = c.getContext('2d'); arrow(g, 50, 50, 50 + LENGTH, 50, 4, 'black', 'white');"
        "return g.getImageData(0, 0, 100, 100).data.filter((v, i) => i % 4 === 3 && v > 0).length })"
    )
    assert page.evaluate(ink.replace("LENGTH", "0")) == 0
    assert page.evaluate(ink.replace("LENGTH", "1")) == 0
    assert page.evaluate(ink.replace("LENGTH", "30")) > 100


def test_numbers_and_contacts_are_those_of_the_frames(page: Page) -> None:
    for place, n in ((0, 1), (2, 3), (4, 5)):
        card = f"document.querySelectorAll('.finger')[{place}]"
        page.until(f"{card}.innerText.includes('{1 + n / 10:.2f}')")
        assert f"{n / 2:.2f}" in page.evaluate(f"{card}.innerText")
        assert "0.50" in page.evaluate(f"{card}.innerText")  # shear (0.3, 0.4)
    # (-4, 3) mm on a tip of 10 mm: left of the middle and below it.
    colour = (
        "((place, x, y) => { const c = document.querySelectorAll('.finger canvas')[place];"
        "const at = v => Math.round(c.width / 2 + v * (c.width / 2 - 3) / 10);"
        "return [...c.getContext('2d').getImageData(at(x), at(y), 1, 1).data] })"
    )
    red = "(([r, g, b]) => r > 190 && Math.max(g, b) < 90)"
    page.until(f"{red}({colour}(0, -4.6, 3))")  # numbers stand before the canvas is drawn
    _, g, _, alpha = page.evaluate(f"{colour}(0, 5, -2)")
    assert g > 90 or alpha < 200, "the thumb has one contact"
    page.until(f"{red}({colour}(2, 5, -2))")


def test_tare_of_the_chosen_finger(page: Page, hand: Hand) -> None:
    page.click(".finger.place1")
    page.until("document.getElementById('whose').textContent.includes('index 2')")
    page.press("t")
    page.until("document.body.innerText.includes('finger 2: the new rest frame is in use')")
    assert hand.applications[2].tares == [False]
    hand.applications[2].touched = True
    page.press("t")
    page.until("document.querySelector('#toast button') !== null")
    page.click("#toast button")
    page.until("document.body.innerText.includes('finger 2: the new rest frame is in use')")
    assert hand.applications[2].tares == [False, True]
    assert hand.applications[1].tares == []


def test_silence_is_shown(page: Page, hand: Hand) -> None:
    hand.running.clear()
    page.until("document.body.dataset.state === 'stale'")
    page.until("document.querySelector('.finger').innerText.includes('no samples')")
    hand.running.set()
    page.until("document.body.dataset.state === 'live'")


def test_no_connection_leaves_this_machine(page: Page) -> None:
    own = page.evaluate("location.origin")
    assert page.requests
    assert all(address.startswith(own) for address in page.requests)
