"""The finger as an ordinary CANopen node: a sink that also listens.

    loop --send--> Node --[NMT state, rate, divider, SYNC]--> sink ==bus==> host
                   ^ objects (SDO, serial requests), NMT, SYNC <============

- It starts by itself (CiA 302-2's self-starting device), for most hands have no NMT master.
- Transmission type 254: samples are sent as they come. 1..240: the newest sample is latched, and each n-th
  SYNC sends it, once: a repetition would look like a new one.
- A fault sends one emergency when it appears, and one with code 0 and the remaining error register when it
  clears (CiA 301, 7.2.7); the fault byte is 0 when none remains.
- Objects are served by the link's reader thread: `Device` methods are called from there, not from the loop.
"""

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from edge.link.commands import CanCommands, SerialCommands
from edge.link.link_sink import LinkSink, SinkCounters
from edge.link.object_server import Device, ObjectServer
from edge.link.params import PARAMS
from edge.link.settings import SettingsFile
from edge.link.sinks import CanClassicSink, CanFdSink, CanSink, SerialSink
from hostlink.wire import FAULTS, FEATURE_BITS, FaultCode, Kind, State, Status, pack_detail, pack_emergency
from hostlink.wire.canid import NODES_MAX
from hostlink.wire.nmt import LEADS_TO, NmtCommand, NmtState

_FAULTS = {fault.code: fault for fault in FAULTS}
_SINCE_THE_LAST = int(Status.FRAMES_DROPPED | Status.CLOCK_STEP)  # The host must hear of these.


class Node:
    """One finger on one link, which it closes.

    settings  where settings live; several nodes of one finger may share one
    number    CANopen node number, the sink's
    state     as a master has set it
    """

    def __init__(
        self, sink: CanSink | SerialSink, device: Device, settings: SettingsFile | None = None
    ) -> None:
        self.sink: LinkSink = sink
        self.name, self.drain, self.close = sink.name, sink.drain, sink.close
        self._device = device
        self._settings = settings or SettingsFile()
        self._sending, self._watching = threading.Lock(), threading.Lock()
        self._latched: tuple[State, float] | None = None
        self._syncs = self._frames = self._dropped_n = self._detail_counter = self._detail_frames = 0
        self._next_us, self._unsaid = 0.0, 0  # status bits of samples that were not sent
        self._active: set[FaultCode] = set()
        self._link_faults: frozenset[FaultCode] = frozenset()
        self.number, self.state = sink.node, NmtState.BOOT_UP
        self.objects = ObjectServer(
            device, self._settings, sink.node, sink.ids, self._changed, self._statistics,
            maps=isinstance(sink, CanClassicSink),
        )  # fmt: skip
        self._commands = CanCommands(sink, self) if isinstance(sink, CanSink) else SerialCommands(sink, self)
        sink.on_faults = self.watch_link
        self._changed("features")
        self._start()

    @property
    def counters(self) -> SinkCounters:
        return self.sink.counters

    def send(self, state: State) -> bool:
        """Send a sample if it is due; True: it was sent. One that is not due is not counted either."""
        self.objects.newest = state
        if self.state is NmtState.OPERATIONAL and self._is_due(state):
            if self.objects.transmission[1] == 254:
                return self._send(state)
            with self._sending:
                self._latched = (state, time.monotonic())
        self._unsaid |= int(state.status) & _SINCE_THE_LAST
        return False

    @property
    def detail_divider(self) -> int:
        """Detail is sent for every n-th measurement; 0: for none."""
        return self._settings.values.detail_divider

    def send_detail(self, sample: int, rows: Sequence[tuple[float, float, float]]) -> bool:
        """Send every pin's (dx px, dy px, relative area change), if asked for, due, and there is capacity.

        Classic CAN has no detail stream: at 6 bytes a frame it would take the samples' share of the bus.
        """
        divider, sink = self.detail_divider, self.sink
        self._detail_frames += 1
        if divider == 0 or self.state is not NmtState.OPERATIONAL or self._detail_frames % divider:
            return False
        if not isinstance(sink, CanFdSink | SerialSink):
            return False
        segments = pack_detail(sample, rows, self._detail_counter)
        items = [sink.encode_detail(segment) for segment in segments]
        if not sink.post_spaced("detail", items, sink.frame_s(len(segments[0])) / PARAMS.spaced_rel):
            return False
        self._detail_counter += len(segments)
        return True

    def report(self, code: FaultCode, active: bool, message: str = "") -> None:
        """A fault appeared or cleared: a listener of `FaultRegistry`. Sends the emergency."""
        if active == (code in self._active):
            return
        (self._active.add if active else self._active.discard)(code)
        if active:
            self.objects.record(_FAULTS[code])
        self._send_emergency(code, active)

    def _send_emergency(self, code: FaultCode, active: bool) -> None:
        register, status = 0, Status(0)
        for held in self._active:
            register |= _FAULTS[held].register
            status |= _FAULTS[held].status
        self.objects.error_register = register
        emcy = _FAULTS[code].emcy if active else 0
        named = int(code) if self._active else 0
        data = pack_emergency(emcy, register, named, int(status))
        self.sink.post(self._commands.item(Kind.EMERGENCY, data))

    def watch_link(self) -> None:
        """Report the link's current faults; called by the sink when they may have changed."""
        with self._watching:
            faults, before = self.sink.faults, self._link_faults
            for code in faults ^ before:
                self._device.report(code, code in faults, f"{self.name}: {_FAULTS[code].meaning}")
            self._link_faults = faults
            if before and not faults:  # emergencies sent meanwhile were lost: repeat them
                for code in sorted(self._active):
                    self._send_emergency(code, True)

    def _start(self) -> None:
        """Send the boot-up message, and be operational, with heartbeat."""
        self._set_heartbeat(0)
        self.state = NmtState.BOOT_UP
        self.sink.post(self._heartbeat())
        self.state = NmtState.OPERATIONAL
        self._set_heartbeat(self._settings.values.heartbeat_ms)

    def _set_heartbeat(self, period_ms: int) -> None:
        """Send the state each period from now on; 0: not."""
        # Fingers that begin together would else send theirs in the same moment for ever.
        phase = self.number / (NODES_MAX + 1)
        self.sink.every(period_ms / 1000.0, self._heartbeat if period_ms else None, phase)

    def _heartbeat(self) -> Any:
        return self._commands.item(Kind.HEARTBEAT, bytes((self.state,)))

    def _send(self, state: State) -> bool:
        dropped_n = self.sink.dropped_n
        if dropped_n != self._dropped_n or not self.sink.up:
            state = replace(state, status=state.status | Status.LINK_FAULT)
        if self._unsaid:
            state = replace(state, status=state.status | self._unsaid)
        sent = self.sink.send(state)
        if sent:
            self._dropped_n, self._unsaid = dropped_n, 0
        else:
            self._unsaid |= int(state.status) & _SINCE_THE_LAST
        return sent

    def _is_due(self, state: State) -> bool:
        """Whether rate and divider allow this sample. At most `rate_hz`, evenly, at any camera rate."""
        settings = self._settings.values
        self._frames += 1
        if self._frames % settings.divider:
            return False
        if settings.rate_hz == 0:
            return True
        period_us, capture_us = 1e6 / settings.rate_hz, state.capture_time_us
        if abs(capture_us - self._next_us) > 2 * period_us:
            self._next_us = capture_us  # first one, after a pause or a clock step
        # Given half a millisecond of jitter, a camera of 100 Hz and a rate of 100 Hz must not give 50 Hz.
        if capture_us < self._next_us - 500:
            return False
        self._next_us += period_us
        return True

    def sync(self) -> None:
        """A SYNC has come: send the latched sample, if it is its turn."""
        every = self.objects.transmission[1]
        if every == 254 or self.state is not NmtState.OPERATIONAL:
            return
        self._syncs += 1
        if self._syncs % every:
            return
        with self._sending:
            latched, self._latched = self._latched, None
        if latched is not None:
            state, since_s = latched
            waited_us = (time.monotonic() - since_s) * 1e6
            self._send(replace(state, latency_us=state.latency_us + waited_us))

    def command(self, number: int) -> None:
        """Take a master's command, if there is such a one."""
        if number not in list(NmtCommand):
            return
        command = NmtCommand(number)
        self.state = LEADS_TO[command]
        if command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            if command is NmtCommand.RESET_NODE:
                self._settings.values = self._settings.load()
                self._changed("features")
            self.objects.reset()
            self._latched = None
            self._start()

    def _changed(self, setting: str) -> None:
        values = self._settings.values
        if setting == "heartbeat_ms":
            self._set_heartbeat(values.heartbeat_ms)
        elif setting == "features":
            names = frozenset(name for name, bit in FEATURE_BITS.items() if values.features & bit)
            self._device.set_features(names)

    def _statistics(self) -> dict[str, int]:
        c = self.sink.counters
        return {
            "sent_n": c.sent,
            "unsent_n": c.dropped,
            "link_lost_n": c.reconnects + (not self.sink.up),
            "detail_dropped_n": c.detail_skipped,
        }
