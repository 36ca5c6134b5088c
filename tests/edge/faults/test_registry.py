"""Active faults, the board monitor, and the service manager."""

import math
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from edge.faults.registry import FaultLog, FaultRegistry
from edge.params import PARAMS
from edge.runtime.board_monitor import BoardMonitor, Thermometer, free_space_problem
from edge.runtime.systemd import Notifier
from hostlink.wire import FAULTS, FaultCode, Status
from tests.support.fault_injection import BOARD, CAMERA, EXPECTED, LINK
from tests.support.waiting import SOON_S


def test_each_fault_is_announced_once_when_it_appears_and_clears() -> None:
    registry, made = FaultRegistry(), list[str]()
    reported: list[tuple[FaultCode, bool, str, bool]] = []
    registry.listeners.append(lambda *what: reported.append((*what, what[0] in registry.active)))

    def message() -> str:
        """Composed only for a fault that appears."""
        made.append("gone")
        return "gone"

    lost = FaultCode.CAMERA_LOST
    for active in (False, True, True, False, False, True):
        registry.report(lost, active, message)
    on, off = (lost, True, "gone", True), (lost, False, "gone", False)
    assert reported == [on, off, on]  # a listener may query the registry
    assert registry.appeared[lost] == len(made) == 2
    assert registry.active == {lost: "gone"}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f.code.name)
def test_each_fault_sets_its_bit_until_the_last_of_the_bit_is_gone(fault: object) -> None:
    registry = FaultRegistry()
    others = [f for f in FAULTS if f.status == fault.status]  # type: ignore[attr-defined]
    for other in others:
        registry.report(other.code, True)
    for i, other in enumerate(others):
        assert registry.status == other.status
        assert len(registry.active) == len(others) - i
        registry.report(other.code, False)
    assert registry.status == Status(0)


def test_the_soak_makes_every_camera_link_and_board_fault_of_the_table() -> None:
    made = frozenset().union(*EXPECTED.values())
    not_made_here = {
        FaultCode.CALIBRATION_MISSING,  # a matter of files
        FaultCode.CALIBRATION_FOREIGN,
        FaultCode.TARE_IMPLAUSIBLE,
        FaultCode.OVERLOAD,  # a matter of the skin
    }
    assert made == set(FaultCode) - not_made_here
    assert set(EXPECTED) == {*CAMERA, *LINK, *BOARD}


def test_each_fault_is_logged_when_it_appears_and_clears(caplog: pytest.LogCaptureFixture) -> None:
    registry, status = FaultRegistry(), list[str]()
    registry.listeners.append(FaultLog(registry, status.append))
    registry.report(FaultCode.BUS_OFF, True, "can0")
    registry.report(FaultCode.DISK_FULL, True, "no room")
    registry.report(FaultCode.BUS_OFF, False)
    assert caplog.messages == ["BUS_OFF: can0", "DISK_FULL: no room", "BUS_OFF cleared"]
    assert status == ["BUS_OFF: can0", "BUS_OFF: can0; DISK_FULL: no room", "DISK_FULL: no room"]


def test_a_fault_that_flickers_does_not_flood_the_log(caplog: pytest.LogCaptureFixture) -> None:
    now_s = 0.0
    registry = FaultRegistry()
    registry.listeners.append(FaultLog(registry, lambda message: None, lambda: now_s))
    for _ in range(240):
        registry.report(FaultCode.PINS_LOST, True, "few")
        registry.report(FaultCode.PINS_LOST, False)
        now_s += 1 / 240
    now_s += PARAMS.rarely_s
    registry.report(FaultCode.PINS_LOST, True, "few")
    assert caplog.messages == [
        "PINS_LOST: few",
        "PINS_LOST cleared",
        "PINS_LOST: few (and 239 times since the last such line)",
    ]


def test_many_threads_leave_a_consistent_set() -> None:
    registry = FaultRegistry()
    balance = dict.fromkeys(FaultCode, 0)

    def listen(code: FaultCode, active: bool, message: str) -> None:
        balance[code] += 1 if active else -1
        assert balance[code] in (0, 1)

    registry.listeners.append(listen)

    def work(seed: int) -> None:
        for i in range(2000):
            registry.report(FaultCode(1 + (i * 7 + seed) % 17), (i + seed) % 3 == 0)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {code for code, n in balance.items() if n} == set(registry.active)


def test_the_hottest_readable_zone_counts(tmp_path: Path) -> None:
    assert math.isnan(Thermometer(tmp_path)())
    for number, text in enumerate(("41200\n", "56100\n", "\n")):
        folder = tmp_path / f"thermal_zone{number}"
        folder.mkdir()
        (folder / "temp").write_text(text)
    assert Thermometer(tmp_path)() == 56.1


def test_heat_is_reported_and_cleared_with_hysteresis() -> None:
    registry, degc = FaultRegistry(), [0.0]
    monitor = BoardMonitor(registry, lambda: degc[0])
    reported = []
    for value in (79.0, 80.0, 78.0, 72.1, 71.9, 79.9, math.nan):
        degc[0] = value
        monitor.check()
        reported.append(FaultCode.OVER_TEMPERATURE in registry.active)
    assert reported == [False, True, True, True, False, False, False]


def test_free_space(tmp_path: Path) -> None:
    assert free_space_problem(tmp_path) == ""
    assert "needed" in free_space_problem(tmp_path, 1 << 60)
    assert "No such file" in free_space_problem(tmp_path / "no")


def test_the_board_monitor_checks_until_closed() -> None:
    checks = threading.Semaphore(0)

    def read() -> float:
        checks.release()
        return 20.0

    monitor = BoardMonitor(FaultRegistry(), read, period_s=0.001)
    monitor.start()
    assert all(checks.acquire(timeout=SOON_S) for _ in range(3))
    monitor.close()
    assert monitor.temperature_degc == 20.0
    assert not monitor._thread.is_alive()


@pytest.fixture
def manager() -> Iterator[socket.socket]:
    """The socket that systemd listens on; the kernel gives it an abstract name that is free."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind("")
        listener.setblocking(False)
        yield listener


def name_of(manager: socket.socket) -> str:
    return f"@{manager.getsockname()[1:].decode()}"


def received(manager: socket.socket) -> list[str]:
    messages: list[str] = []
    with suppress(BlockingIOError):
        while True:
            messages.append(manager.recv(4096).decode())
    return messages


@pytest.mark.parametrize(
    ("environment", "notified_n"),
    [
        ({"WATCHDOG_USEC": "2"}, 3),  # every microsecond
        ({"WATCHDOG_USEC": "60000000"}, 1),  # no more often than required
        ({"WATCHDOG_USEC": "4", "WATCHDOG_PID": "1"}, 0),  # another process's
    ],
)
def test_ready_once_then_the_watchdog_while_images_flow(
    manager: socket.socket, environment: dict[str, str], notified_n: int
) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": name_of(manager), **environment})
    assert received(manager) == []  # not ready before the first image
    for _ in range(3):
        notifier.frame()
    assert received(manager) == ["READY=1"] + ["WATCHDOG=1"] * notified_n
    notifier.stopping()
    notifier.close()
    notifier.frame()
    assert received(manager) == ["STOPPING=1"]


def test_a_line_of_status_and_no_manager(manager: socket.socket, tmp_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "gone")}):
        Notifier(environment).frame()
    Notifier({"NOTIFY_SOCKET": name_of(manager)}).status("two\nlines")
    assert received(manager) == ["STATUS=two lines"]
