"""How full a bus gets, against its bit rate: `plan` checks whether a configuration fits, and suggests one
that would.

Frame times with worst-case stuffing: `hostlink.wire.timing`. Heartbeats are counted; what SDO transfers
and emergencies need is covered by LIMIT.
"""

from __future__ import annotations

from dataclasses import dataclass

from hostlink.wire.fields import PARTS, STATE_SIZE
from hostlink.wire.timing import classic_frame_s, fd_frame_s, serial_frame_s

__all__ = ["LIMIT", "Load", "plan"]

LIMIT = 0.9
"""Largest planned load. A tenth stays free: a segmented SDO upload or a burst of EMCY must get through."""

CLASSIC_PARTS = len(PARTS)  # frames of 8 bytes that one sample takes when everything in it is valid
HEARTBEAT_HZ = 2.0  # object 0x1017, default 500 ms


@dataclass(frozen=True, slots=True)
class Load:
    """The load of a configuration on its bus.

    kind      "fd", "classic" or "serial"
    sample_s  time that one sample of one finger occupies the bus, at worst
    share     busy share of the bus, 0..; above LIMIT it does not fit
    advice    what would fit; empty when it does
    """

    kind: str
    fingers: int
    rate_hz: float
    bitrate: int
    dbitrate: int | None
    sample_s: float
    share: float
    advice: tuple[str, ...] = ()

    @property
    def fits(self) -> bool:
        return self.share <= LIMIT


def plan(kind: str, fingers: int, rate_hz: float, bitrate: int, dbitrate: int | None = None) -> Load:
    """Load of `fingers` sending `rate_hz` samples each, and what would fit if that does not.

    kind      "fd" (needs dbitrate), "classic" or "serial" (bitrate = baud; one finger a line)
    bitrate   bit/s of the arbitration phase, or baud
    """
    sample_s = _sample_s(kind, bitrate, dbitrate)
    share = _share(kind, fingers, rate_hz, bitrate, dbitrate)
    load = Load(kind, fingers, rate_hz, bitrate, dbitrate, sample_s, share)
    if load.fits:
        return load
    return Load(kind, fingers, rate_hz, bitrate, dbitrate, sample_s, share, tuple(_advise(load)))


def _sample_s(kind: str, bitrate: int, dbitrate: int | None) -> float:
    if kind == "fd":
        return fd_frame_s(STATE_SIZE, bitrate, dbitrate or bitrate)
    if kind == "classic":
        return CLASSIC_PARTS * classic_frame_s(8, bitrate)
    return serial_frame_s(STATE_SIZE, bitrate)


def _share(kind: str, fingers: int, rate_hz: float, bitrate: int, dbitrate: int | None) -> float:
    heartbeat_s = 0.0 if kind == "serial" else classic_frame_s(1, bitrate)
    # One finger to a serial line: more fingers take more lines, not more of this one.
    sharing = 1 if kind == "serial" else fingers
    return sharing * (rate_hz * _sample_s(kind, bitrate, dbitrate) + HEARTBEAT_HZ * heartbeat_s)


def _advise(load: Load) -> list[str]:
    """The changes that would fit, the smallest first: rate, fingers, bit rates, FD."""
    advice = []
    fits = int(load.rate_hz * LIMIT / load.share)
    while fits > 0 and _share(load.kind, load.fingers, fits, load.bitrate, load.dbitrate) > LIMIT:
        fits -= 1
    if fits > 0:
        advice.append(f"{fits} Hz with everything else as it is")
    if load.kind == "serial":
        needed = next((b for b in _BAUDS if _share("serial", 1, load.rate_hz, b, None) <= LIMIT), None)
        if needed:
            advice.append(f"{needed} baud")
        return advice
    alone = load.share / load.fingers
    if 1 <= int(LIMIT / alone) < load.fingers:
        advice.append(f"{int(LIMIT / alone)} fingers a bus at {load.rate_hz:g} Hz")
    for kind, bitrate, dbitrate in _RATES:
        faster = kind == "fd" or (load.kind == "classic" and bitrate > load.bitrate)
        if faster and _share(kind, load.fingers, load.rate_hz, bitrate, dbitrate) <= LIMIT:
            at = (
                f"{bitrate / 1e6:g} Mbit/s"
                if dbitrate is None
                else f"{bitrate / 1e6:g}/{dbitrate / 1e6:g} Mbit/s"
            )
            advice.append(f"{'CAN FD' if kind == 'fd' else 'classic CAN'} at {at}")
            break
    return advice


_BAUDS = (115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 12_000_000)
_RATES: tuple[tuple[str, int, int | None], ...] = (
    ("classic", 500_000, None),
    ("classic", 1_000_000, None),
    ("fd", 500_000, 2_000_000),
    ("fd", 1_000_000, 5_000_000),
    ("fd", 1_000_000, 8_000_000),
)
"""The rates that hands use, slowest first (CiA 601-3 recommends 0.5/2 and 1/5 Mbit/s)."""
