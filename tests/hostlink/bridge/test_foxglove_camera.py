"""A finger's camera in Foxglove: what the viewer gets is what the finger's page has."""

import logging
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from mcap.reader import make_reader

from edge.cells import cell_polygons
from hostlink.bridge.foxglove import FoxgloveOutlet
from hostlink.bridge.page_camera import PageAddress, PageCamera, Picture, parse_page
from hostlink.commands.plot import read_series
from hostlink.web import Listen, PageServer, pack_packet, parse_listen, unpack_packet
from tests.hostlink.bridge.hand import Hand
from tests.hostlink.bridge.test_foxglove import Viewer, bridged, state, watch
from tests.support.commands import run_host as run
from tests.support.viewing import Live
from tests.support.waiting import present, until

TOPICS = tuple(f"/finger_3/{name}" for name in ("camera/image", "pins/overlay", "cells/overlay"))
HEADER = {"capture_us": 5_000_000, "size_px": [1280, 800], "image_px": [640, 400]}
ARRAYS = {
    "image": ("jpeg", b"\xff\xd8 not really"),
    "pins": ("f4", np.array([[99.5, 49.5], [np.nan, np.nan]], "<f4").tobytes()),
    "corners_n": ("u2", np.array([3, 0], "<u2").tobytes()),
    "corners": ("f4", np.array([[-0.5, -0.5], [9.5, -0.5], [9.5, 9.5]], "<f4").tobytes()),
    "rgba": ("f4", np.array([[1, 0, 0, 0.5], [0, 0, 1, 0]], "<f4").tobytes()),
}


class Page:
    """A finger's page that always shows the same picture."""

    def __init__(
        self, port: int = 0, token: str | None = None, hello: str = "source", first: Iterable[bytes] = ()
    ) -> None:
        self.wants: list[frozenset[str] | None] = []
        packets = chain(first, repeat(pack_packet(HEADER, ARRAYS)))
        self.server = PageServer(
            parse_listen(f"127.0.0.1:{port}", token),
            "edge.view",
            lambda wants: next(packets),
            {hello: "a camera"},
            on_wants=self.wants.append,
            wishes=("image", "cells"),
        )
        self.server.start()

    @property
    def address(self) -> PageAddress:
        return parse_page(f"3={self.server.url}")


@pytest.fixture
def page() -> Iterator[Page]:
    made = Page(token="a-long-token")
    yield made
    made.server.close()


@pytest.fixture
def hand(request: pytest.FixtureRequest) -> Iterator[Hand]:
    with Hand(f"fox-camera-{request.node.name}", (3,), state) as made:
        yield made


@contextmanager
def pictures_of(address: PageAddress) -> Iterator[list[Picture]]:
    """Pictures of a page, as they come."""
    pictures: list[Picture] = []
    with closing(PageCamera(address, pictures.append)) as camera:
        camera.want(frozenset({"image"}))
        yield pictures


def test_image_pins_and_cells_are_the_finger_s(hand: Hand, data_dir: Path) -> None:
    begun_ns = time.time_ns()
    with Live(data_dir / "press.mcap", data_dir / "rings331_ball.json") as live:
        live.show(-1)
        outlet = bridged(hand, pages=[parse_page(f"3={live.url}")])

        async def visit(viewer: Viewer) -> None:
            await viewer.subscribe(*TOPICS)
            got = viewer.messages
            await viewer.until(lambda: len(got.get(TOPICS[2], ())) > 3, "pictures")
            result = present(live.loop.measurement.last)
            assert result.cells is not None
            at_ns, data = got[TOPICS[0]][-1]
            image = CompressedImage.FromString(data)
            assert image.format == "jpeg"
            assert begun_ns < image.timestamp.ToNanoseconds() == at_ns < time.time_ns()
            shown = present(cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_GRAYSCALE))
            assert np.abs(shown.astype(float) - result.frame.image).mean() < 3.0  # a JPEG's error

            (pins,) = ImageAnnotations.FromString(got[TOPICS[1]][-1][1]).points
            assert pins.type == pins.POINTS
            places = np.array([(p.x, p.y) for p in pins.points])
            seen = result.tracks.xy_img[np.isfinite(result.tracks.xy_img).all(axis=1)]
            errors = np.abs(places - (seen + 0.5))
            assert np.median(errors) < 1e-3
            assert errors.max() < 0.25  # one that is seen badly differs between two images

            at_ns, data = got[TOPICS[2]][-1]
            cells = ImageAnnotations.FromString(data).points
            polygons = [p for p in cell_polygons(result.cells) if len(p)]
            assert len(cells) == len(polygons) > 320
            for cell, polygon in zip(cells, polygons, strict=True):
                assert cell.type == cell.LINE_LOOP
                centre = np.mean([(p.x, p.y) for p in cell.points], axis=0)
                assert np.abs(centre - polygon.mean(axis=0) - 0.5).max() < 0.5
            strongest = max(cells, key=lambda cell: cell.fill_color.a)
            assert strongest.fill_color.r > 0.7 > 0.3 > strongest.fill_color.b  # compressed

        watch(outlet.url, visit)
        hand.close()


def test_places_are_scaled_with_the_picture() -> None:
    header, arrays = unpack_packet(pack_packet(HEADER, ARRAYS))
    picture = Picture(header, arrays)
    assert picture.pins() == [(50.0, 25.0)]
    assert picture.cells() == [([(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)], (1.0, 0.0, 0.0, 0.5))]


def test_pictures_are_stamped_by_the_samples_clock_across_its_wrap(page: Page) -> None:
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0), pages=[page.address])) as outlet:
        (camera,) = outlet._cameras  # no public way in: the SDK alone holds the rest
        camera.clock.note((1 << 32) - 1_000_000, 100_000_000_000)

        async def visit(viewer: Viewer) -> None:
            await viewer.subscribe(TOPICS[0])
            await viewer.until(lambda: viewer.messages, "a picture")
            assert viewer.messages[TOPICS[0]][0][0] == 106_000_000_000  # 1 s before the wrap, 5 s after it

        watch(outlet.url, visit)


def test_the_page_is_watched_only_while_somebody_watches_the_camera(hand: Hand, page: Page) -> None:
    outlet = bridged(hand, pages=[page.address])

    async def visit(viewer: Viewer) -> None:
        await viewer.subscribe("/finger_3/sample")
        await viewer.until(lambda: viewer.messages, "a sample")
        assert page.wants == []
        await viewer.subscribe(TOPICS[0])
        await viewer.until(lambda: TOPICS[0] in viewer.messages, "an image")
        assert page.wants == [frozenset({"image"})]
        await viewer.subscribe(TOPICS[2])
        await viewer.until(lambda: page.wants[-1] == frozenset({"image", "cells"}), "cells")
        for number in (2, 3):
            await viewer.say(op="unsubscribe", subscriptionIds=[number])
        await viewer.until(lambda: page.wants[-1] is None, "nobody watches the page")
        await viewer.ask(2)
        n = len(viewer.messages[TOPICS[0]])
        await viewer.until(lambda: len(viewer.messages[TOPICS[0]]) > n, "images again")

    watch(outlet.url, visit)
    until(lambda: page.wants[-1] is None, "nobody watches the page")


def test_a_recording_has_the_camera_though_nobody_watches(hand: Hand, page: Page, tmp_path: Path) -> None:
    path = tmp_path / "hand.mcap"
    bridged(hand, record=path, pages=[page.address])
    until(lambda: page.server.sent_n > 10, "pictures")
    hand.close()
    with path.open("rb") as file:
        summary = present(make_reader(file).get_summary())
    messages_n = present(summary.statistics).channel_message_counts
    counts = {channel.topic: messages_n[channel.id] for channel in summary.channels.values()}
    assert min(counts[topic] for topic in TOPICS) > 5
    drawn = read_series(path)
    assert {3: counts["/finger_3/sample"]} == {n: one.samples_n for n, one in drawn.items()}


def reports(caplog: pytest.LogCaptureFixture) -> list[logging.LogRecord]:
    """What the bridge logs; the page's server has its own."""
    return [record for record in caplog.records if record.name == "hostlink.bridge.page_camera"]


def test_a_page_that_goes_comes_back(caplog: pytest.LogCaptureFixture) -> None:
    page = Page()
    with pictures_of(page.address) as pictures:
        until(lambda: pictures, "a picture")
        page.server.close()
        until(lambda: reports(caplog), "a warning")
        pictures.clear()
        page = Page(page.server.port)
        until(lambda: pictures, "a picture again")
    page.server.close()
    records = reports(caplog)
    assert {record.levelno for record in records} == {logging.WARNING}
    assert all(str(page.server.port) in line.message and "trying again" in line.message for line in records)


@pytest.mark.parametrize(
    ("token", "hello", "why"),
    [
        ("a-long-token", "source", "the token is missing or wrong"),
        (None, "address", "not the page of a finger"),
    ],
)
def test_a_page_without_pictures_is_reported_once(
    token: str | None, hello: str, why: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hostlink.bridge.page_camera.RETRY_S", 0.01)
    page = Page(token=token, hello=hello)
    address = PageAddress(3, page.address.url, "a-wrong-token" if token else "")
    visits: list[str] = []
    visit = PageCamera._visit

    async def counted(self: PageCamera) -> str:
        visits.append(why)
        return await visit(self)

    monkeypatch.setattr(PageCamera, "_visit", counted)
    with pictures_of(address) as pictures:
        until(lambda: len(visits) > 2, "several visits")
    page.server.close()
    assert pictures == []
    (report,) = reports(caplog)
    assert why in report.message


def packet(text: bytes) -> bytes:
    return len(text).to_bytes(4, "little") + text


NO_TIMES: tuple[Any, ...] = ("", [], None, "1" * 5000)
BAD_PACKETS = [
    *(pack_packet(HEADER | {"size_px": px}, ARRAYS) for px in ([0, 0], [0.0, 1], [1e-320, 1], [1], None)),
    *(pack_packet(HEADER | {"capture_us": us}, ARRAYS) for us in NO_TIMES),
    packet(b'{"capture_us": 1e999, "arrays": {"image": ["jpeg", 1, 0]}}'),
    packet(b"[" * 100_000),
    packet(b'{"arrays": {"image": ["jpeg", 1, 1e999]}}'),
    packet(b'{"arrays": {"image": ["f4", -8, 0]}}'),
    pack_packet(HEADER, ARRAYS | {"corners_n": ("u2", b"\xff\xff" * 9)}),
    b"", b"\0", b"\xff" * 100,
]  # fmt: skip


def test_whatever_a_page_sends_the_camera_comes_back(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hostlink.bridge.page_camera.RETRY_S", 0.01)
    page = Page(first=BAD_PACKETS)
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0), pages=[page.address])) as outlet:

        async def visit(viewer: Viewer) -> None:
            await viewer.subscribe(*TOPICS)
            await viewer.until(lambda: TOPICS[2] in viewer.messages, "the good picture")

        watch(outlet.url, visit)
    page.server.close()
    assert page.server.sent_n > len(BAD_PACKETS)
    assert len(reports(caplog)) == 1


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("http://127.0.0.1:8765", (1, "http://127.0.0.1:8765/", "")),
        ("2=http://finger-2:8765/#token=a-b_c=", (2, "http://finger-2:8765/", "a-b_c=")),
        ("https://board/", (1, "https://board/", "")),
    ],
)
def test_addresses(text: str, address: tuple[int, str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VORONOI_TOUCH_VIEW_TOKEN", raising=False)
    assert parse_page(text) == PageAddress(*address)
    monkeypatch.setenv("VORONOI_TOUCH_VIEW_TOKEN", "from-outside")
    assert parse_page(text).token == (address[2] or "from-outside")


@pytest.mark.parametrize(
    "text",
    ["", "127.0.0.1:8765", "0=http://a", "128=http://a", "http://", "x=http://a", "http://a:99999", "ws://a"],
)
def test_bad_addresses_are_one_line(text: str) -> None:
    refusal = run("bridge", "virtual:none", "--foxglove", "--view", text).refusal
    assert "not the page of a finger" in refusal
