"""The live page's protocol: permissions, contents of packets, cost of viewers."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import aiohttp
import numpy as np
import pytest
from mcap.reader import make_reader

from edge.recording.reader import RecordingSource
from edge.types import Feature
from edge.view.scene import CHART
from edge.worker.page import LivePage
from edge.worker.params import PARAMS
from hostlink.web import PageServer, WebError, parse_listen, unpack_packet
from hostlink.wire import FaultCode
from tests.support.cell_checks import points_of
from tests.support.messages import read_messages
from tests.support.processes import python
from tests.support.refusals import one_line
from tests.support.viewing import TOKEN, Live
from tests.support.waiting import SOON_S

PRESSED = -1


@pytest.fixture(scope="module")
def live(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with Live(
        data_dir / "press.mcap",
        data_dir / "rings331_ball.json",
        recordings=tmp_path_factory.mktemp("recordings") / "new",
    ) as running:
        yield running


class Viewer:
    """A viewer without a screen."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.got_n = 0
        self.hello: dict[str, Any] = {}
        self.answer: dict[str, Any] = {}

    async def packet(self) -> dict[str, Any]:
        """The next packet, as the page unpacks it; answers on the way wait."""
        while True:
            message = await self.socket.receive(SOON_S)
            if message.type is aiohttp.WSMsgType.TEXT:
                self.answer = json.loads(message.data)
                continue
            assert message.type is aiohttp.WSMsgType.BINARY, message
            self.got_n += 1
            await self.socket.send_json({"got": self.got_n})
            return unpack(message.data)

    async def until(self, condition: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        async with asyncio.timeout(SOON_S):
            while not condition(packet := await self.packet()):
                pass
            return packet

    async def do(self, name: str, **more: Any) -> dict[str, Any]:
        self.answer = {}
        await self.socket.send_json({"do": name, **more})
        await self.until(lambda _: self.answer)
        return self.answer


def unpack(data: bytes) -> dict[str, Any]:
    header, arrays = unpack_packet(data)
    numbers = {name: np.array(value) for name, value in arrays.items() if not isinstance(value, bytes)}
    return header | {"arrays": arrays | numbers}


def watch(
    url: str, then: Callable[[Viewer], Awaitable[Any]], token: str = "", want: tuple[str, ...] = ()
) -> Any:
    """Open a viewer of the page at an address, and run a test with it."""

    async def run() -> Any:
        live = f"{url.partition('#')[0]}live"
        async with aiohttp.ClientSession() as session, session.ws_connect(live) as socket:
            viewer = Viewer(socket)
            await socket.send_json({"token": token, "want": list(want)})
            viewer.hello = await socket.receive_json()
            return await then(viewer)

    return asyncio.run(run())


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("", "127.0.0.1", 8765),
        ("9000", "127.0.0.1", 9000),
        (":9000", "127.0.0.1", 9000),
        ("localhost", "localhost", 8765),
        ("127.0.0.1:9000", "127.0.0.1", 9000),
        ("[::1]:9000", "::1", 9000),
        ("::1", "::1", 8765),
    ],
)
def test_addresses(text: str, host: str, port: int) -> None:
    listen = parse_listen(text)
    assert (listen.host, listen.port, listen.token) == (host, port, "")


@pytest.mark.parametrize("text", ["0.0.0.0", "192.168.1.5:9000", "[::]:9000", "finger.local"])
def test_others_can_reach_it_only_with_a_token(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.getaddrinfo", lambda host, port: [])  # finger.local is known, too
    assert "give a token" in one_line(WebError, parse_listen, text)
    one, other = (parse_listen(text, "auto").token for _ in range(2))
    assert len(one) >= 20
    assert one != other


def test_bad_addresses_are_one_line(live: Live) -> None:
    for text, token in (("127.0.0.1:http", None), ("127.0.0.1:99999", None), ("", "short")):
        one_line(WebError, parse_listen, text, token)
    used = PageServer(parse_listen(live.worker.url.split("/")[2]), "edge.view", lambda wants: None, {})
    assert "give another HOST:PORT" in one_line(WebError, used.start)


def get(live: Live, path: str) -> tuple[int, str, Any]:
    """The path as it is: other clients resolve its dots themselves."""
    with closing(HTTPConnection(live.worker.url.split("/")[2])) as connection:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers


def test_files_are_ours_and_name_no_one_else(live: Live) -> None:
    for name in ("", "index.html", "kit.js", "kit.css", "touch.js", "touch.css", "icon.svg"):
        status, text, headers = get(live, f"/{name}")
        assert status == 200
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "https://" not in text
        assert text.count("http://") == text.count("http://www.w3.org/2000/svg")
    for name in ("live.py", "../live.py", "%2e%2e/live.py", "etc/passwd", "server.py"):
        assert get(live, f"/{name}")[0] in (403, 404)


def test_without_the_token_a_viewer_may_only_watch(live: Live) -> None:
    async def look(viewer: Viewer) -> None:
        assert viewer.hello["may"] == []
        assert (await viewer.packet())["pins_n"] == 331
        for command in ("tare", "record", "rm -rf"):
            answer = await viewer.do(command)
            assert not answer["ok"]
            assert command == "rm -rf" or "token" in answer["message"]

    tares_n = live.loop.measurement.tares_n
    watch(live.url, look)
    assert live.loop.measurement.tares_n == tares_n
    assert live.loop.session.put is None


def test_a_packet_holds_what_the_loop_measured(live: Live) -> None:
    live.show(PRESSED)
    results: dict[int, Any] = {}

    def keep(result: Any, state: Any) -> None:
        results[result.frame.sequence] = result

    async def look(viewer: Viewer) -> dict[str, Any]:
        return await viewer.until(
            lambda p: p.get("touched") and "change" in p["arrays"] and p["sequence"] in results
        )

    live.loop.result_callbacks.append(keep)
    packet = watch(live.url, look, want=("image",))
    live.loop.result_callbacks.remove(keep)
    result = results[packet["sequence"]]
    assert result.features is not None
    assert result.cells is not None
    arrays = packet["arrays"]
    for name, values in (
        ("pins", result.tracks.xy_img),
        ("change", result.features.area_change),
        ("motion", result.features.displacement_px),
        ("points", points_of(result.cells)),
        ("triangles", result.cells.triangles),
    ):
        np.testing.assert_allclose(arrays[name], values.ravel(), rtol=1e-6, atol=1e-6, err_msg=name)
    assert arrays["image"][:2] == b"\xff\xd8"
    assert packet["size_px"] == [320, 320]
    assert (packet["held_n"], packet["pins_n"]) == (result.tracks.n_seen, 331)
    assert packet["values"]["displacement_mm"] == pytest.approx(3.0, abs=0.3)
    assert len(packet["contacts"]) == 1


def test_charts_get_every_sample_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows overlap from packet to packet, so that a viewer that was sent every second one has no gap."""
    now_s = 100.0
    monkeypatch.setattr("edge.worker.page.time", SimpleNamespace(monotonic=lambda: now_s))
    page = LivePage(parse_listen("127.0.0.1:0"), "a camera", "T-1", {}, lambda wants: None)
    seen, packets_n = list[float](), 0
    for n in range(120):
        now_s += 1 / 60
        row = (now_s, float(n), *[0.0] * (len(CHART) - 2))
        page.show(now_s, now_s, n, [row], None, None, None, {"pins_n": 3})
        if n % 5:
            continue
        made = page._make(frozenset())
        assert made is not None
        packets_n += 1
        packet = unpack(made)
        rows = packet["arrays"]["rows"].reshape(-1, len(CHART))
        assert packet["rows_n"] == n + 1
        assert rows[-1, 0] == 0.0  # seconds before the packet
        assert rows[0, 0] >= np.float32(-PARAMS.recent_s)
        if packets_n % 2:
            first = packet["rows_n"] - len(rows)
            assert first <= len(seen)
            seen += rows[len(seen) - first :, 1].tolist()
    assert seen == list(range(111))  # up to the last packet that this viewer was sent


def test_features_not_in_demand_are_neither_computed_nor_sent(live: Live) -> None:
    pipeline = live.loop.measurement.pipeline
    assert pipeline is not None

    async def plain(viewer: Viewer) -> None:
        packet = await viewer.until(lambda p: "change" in p["arrays"])
        assert "image" not in packet["arrays"]
        assert "surface" not in packet["arrays"]
        assert Feature.SURFACE not in pipeline.demand
        await viewer.socket.send_json({"want": ["surface", "nonsense"]})
        packet = await viewer.until(lambda p: "surface" in p["arrays"])
        size = packet["grid"][3]
        assert len(packet["arrays"]["surface"]) == size * size
        assert Feature.SURFACE in pipeline.demand

    live.show(PRESSED)
    watch(live.url, plain)
    live.until(lambda: Feature.SURFACE not in pipeline.demand, "the surface is not computed any more")
    shown = live.worker.view._shown
    live.show(0)
    live.show(PRESSED)
    assert live.worker.view._shown is shown, "nothing more was sent to the page's process"
    assert not live.worker.view._rows


def test_faults_have_readable_messages(live: Live) -> None:
    async def look(viewer: Viewer) -> None:
        live.loop.faults.report(FaultCode.OVER_TEMPERATURE, True, "71 degC, the limit is 70")
        packet = await viewer.until(lambda p: p["faults"])
        assert ["board or camera too warm", "71 degC, the limit is 70"] in packet["faults"]
        live.loop.faults.report(FaultCode.OVER_TEMPERATURE, False)
        await viewer.until(lambda p: not p["faults"])

    watch(live.url, look)


def test_record_loses_nothing(live: Live) -> None:
    async def press(viewer: Viewer) -> str:
        answer = await viewer.do("record")
        assert answer["ok"], answer
        packet = await viewer.until(lambda p: p.get("recording") and p["recording"]["frames_n"] > 20)
        assert packet["recording"]["dropped_n"] == 0
        answer = await viewer.do("record")
        assert answer["ok"], answer
        await viewer.until(lambda p: "recording" not in p)
        return str(answer["message"])

    live.show(PRESSED)
    message = watch(live.url, press, TOKEN)
    path = live.recordings / message.split(":")[0]
    frames = list(RecordingSource(path))
    assert f"{len(frames)} frames" in message
    sequences = [frame.sequence for frame in frames]
    dropped_n = live.source.dropped_n
    assert len(frames) > 20
    assert sequences == list(range(sequences[0], sequences[0] + len(frames))) or dropped_n
    samples = [m["sequence"] for _, _, m in read_messages(path, ["/finger_1/sample"])]
    assert samples == list(range(samples[0], samples[0] + len(sequences)))
    assert live.loop.measurement.calibration is not None
    with path.open("rb") as file:
        assert [a.data for a in make_reader(file).iter_attachments()] == [
            live.loop.measurement.calibration.encoded
        ]


def test_an_unwritable_folder_is_reported(live: Live) -> None:
    folder, away = live.recordings, live.recordings.with_name("away")
    folder.mkdir(exist_ok=True)
    folder.rename(away)
    folder.write_text("a file where the folder should be")
    answer = watch(live.url, lambda viewer: viewer.do("record"), TOKEN)
    folder.unlink()
    away.rename(folder)
    assert not answer["ok"]
    assert "give another folder" in answer["message"]
    assert live.loop.session.put is None


def test_the_page_needs_its_extra() -> None:
    code = (
        "import sys; sys.modules['aiohttp'] = None\n"
        "from hostlink.web import PageServer, parse_listen, WebError\n"
        "try: PageServer(parse_listen(''), 'edge.view', lambda w: None, {}).start()\n"
        "except WebError as error: print(error)"
    )
    assert "install voronoi-touch[view]" in python("-c", code).stdout
