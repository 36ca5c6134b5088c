"""The host's page in a real browser: several fingers as a hand, from frames on a bus."""

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest
from playwright.sync_api import BrowserContext, Page

import hostlink
from hostlink.view import HandView
from hostlink.web import parse_listen
from hostlink.wire import Contact, State, Status
from tests.browser.pages import errors, opened
from tests.support.bus import open_wire
from tests.support.fingers import Fingers, state

BUS = f"udp:239.0.0.8?port={21_000 + os.getpid() % 20_000}"
LISTEN = parse_listen("127.0.0.1:0", "a-token-for-tests")
FINGERS = (1, 2, 3, 5)  # the ring finger is missing


def sample(n: int, k: int) -> State:
    """Each pressed by its number in tenths of a millimetre or more."""
    contacts = (Contact(-4.0, 3.0, 1.0), Contact(5.0, -2.0, 0.5))[: 2 if n == 3 else 1]
    return state(
        k, status=Status.TOUCHED, displacement_mm=1 + n / 10, force_n=n / 2, shear_x_mm=0.3, shear_y_mm=0.4,
        contact_n=len(contacts), contacts=contacts,
    )  # fmt: skip


@pytest.fixture(scope="module")
def hand() -> Iterator[Fingers]:
    with Fingers(BUS, FINGERS, sample) as made:
        yield made


@contextmanager
def page_of(bus: str, context: BrowserContext) -> Iterator[Page]:
    """The page of the fingers on a bus."""
    with hostlink.connect(bus) as connection, closing(HandView(connection, LISTEN)) as view:
        view.start()
        with closing(opened(context, view.server.url)) as page:
            page.wait_for_function("() => document.body.dataset.state === 'live'")
            yield page
            assert errors(page) == []


@pytest.fixture
def page(hand: Fingers, context: BrowserContext) -> Iterator[Page]:
    with page_of(BUS, context) as made:
        made.wait_for_function("() => document.querySelectorAll('.finger canvas').length === 4")
        yield made


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


def test_one_finger_has_its_charts_beside_it_on_one_screen(context: BrowserContext) -> None:
    bus = f"udp:239.0.0.8?port={41_000 + os.getpid() % 20_000}"  # the other tests use its port
    with Fingers(bus, (2,), sample), page_of(bus, context) as page:
        page.wait_for_function("() => document.querySelectorAll('.finger canvas').length === 1")
        # A value has its chart from its first one on; nothing feeds the torsion.
        page.wait_for_function("() => document.querySelectorAll('.chart:not([hidden])').length === 5")
        finger, *charts = page.evaluate(
            "[...document.querySelectorAll('.finger, .chart:not([hidden])')].map(e => {"
            "const r = e.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom] })"
        )
        assert len(charts) == 5
        assert all(left > finger[2] for left, *_ in charts)
        assert max(bottom for *_, bottom in (finger, *charts)) <= page.evaluate("innerHeight")
        assert page.evaluate("document.getElementById('next').disabled")


def test_twenty_fingers_are_on_one_screen(context: BrowserContext) -> None:
    with open_wire("page") as wire, closing(HandView(wire.hand, LISTEN)) as view:
        view.start()
        for n in range(1, 21):
            wire.send_state(n, sample(n % 5, 0))
        with closing(opened(context, view.server.url)) as page:
            page.wait_for_function("() => document.querySelectorAll('.finger canvas').length === 20")
            assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
            names = page.evaluate("[...document.querySelectorAll('.finger h2 span')].map(e => e.innerText)")
    known = ["thumb", "index", "middle", "ring", "little"]
    assert names == [f"{name} {n}" for n, name in enumerate([*known, *["finger"] * 15], 1)]


def test_a_chart_is_shown_once_it_has_a_value(page: Page) -> None:
    script = (
        "import('./kit.js').then(({ Chart }) => { const box = document.createElement('section');"
        "box.className = 'chart'; box.append(document.createElement('canvas')); document.body.append(box);"
        "const chart = new Chart(box.firstChild, {}); const hidden = [];"
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
        page.wait_for_function(f"() => {card}.innerText.includes('{1 + n / 10:.2f}')")
        assert f"{n / 2:.2f}" in page.evaluate(f"{card}.innerText")
        assert "0.50" in page.evaluate(f"{card}.innerText")  # shear (0.3, 0.4)
    # (-4, 3) mm on a tip of 10 mm: left of the middle and below it.
    colour = (
        "((place, x, y) => { const c = document.querySelectorAll('.finger canvas')[place];"
        "const at = v => Math.round(c.width / 2 + v * (c.width / 2 - 3) / 10);"
        "return [...c.getContext('2d').getImageData(at(x), at(y), 1, 1).data] })"
    )
    red = "(([r, g, b]) => r > 190 && Math.max(g, b) < 90)"
    page.wait_for_function(f"() => {red}({colour}(0, -4.6, 3))")  # numbers stand before the canvas is drawn
    _, g, _, alpha = page.evaluate(f"{colour}(0, 5, -2)")
    assert g > 90 or alpha < 200, "the thumb has one contact"
    page.wait_for_function(f"() => {red}({colour}(2, 5, -2))")


def test_tare_of_the_chosen_finger(page: Page, hand: Fingers) -> None:
    page.click(".finger.place1")
    page.wait_for_function("() => document.getElementById('whose').textContent.includes('index 2')")
    page.keyboard.press("t")
    page.wait_for_function("() => document.body.innerText.includes('finger 2: the new rest frame is in use')")
    assert hand.applications[2].tares == [False]
    hand.applications[2].touched = True
    page.keyboard.press("t")
    page.click("#toast button")
    page.wait_for_function("() => document.body.innerText.includes('finger 2: the new rest frame is in use')")
    assert hand.applications[2].tares == [False, True]
    assert hand.applications[1].tares == []


def test_silence_is_shown(page: Page, hand: Fingers) -> None:
    hand.running.clear()
    page.wait_for_function("() => document.body.dataset.state === 'stale'")
    page.wait_for_function("() => document.querySelector('.finger').innerText.includes('no samples')")
    hand.running.set()
    page.wait_for_function("() => document.body.dataset.state === 'live'")


def test_no_connection_leaves_this_machine(page: Page) -> None:
    own = page.evaluate("location.origin")
    assert page.requests()
    assert all(request.url.startswith(own) for request in page.requests())
