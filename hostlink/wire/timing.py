"""How long a frame occupies the wire, with worst-case stuffing.

Worst case because an engineer has to plan with it: a payload that needs a stuff bit after every fourth bit is
rare, but possible.

    classic  SOF ID11 RTR IDE r0 DLC4 | data 8n | CRC15 | CRC-del ACK ACK-del EOF7 IFS3
             stuffing: one bit after 5 equal ones, the stuffed bit counting itself: (34 + 8n - 1) / 4
    FD       SOF ID11 RRS IDE FDF res BRS | ESI DLC4 data 8n stuff-count4 CRC CRC-del | ACK .. IFS3
             nominal rate                 | data rate; fixed stuff bits in the CRC    | nominal rate

Source: ISO 11898-1:2015, 10.4 and 10.5.
Gives 135 us for 8 bytes at 1 Mbit/s, 169 us for 64 bytes at 1/5 Mbit/s, 406 us at 0.5/2.
"""

from __future__ import annotations

__all__ = ["classic_frame_s", "fd_frame_s", "serial_frame_s"]

SERIAL_OVERHEAD = 8  # type byte, CRC-32, COBS code byte, 0x00 before and behind
SERIAL_BITS = 10  # start, 8 data, stop


def classic_frame_s(n_bytes: int, bitrate: int) -> float:
    """Longest duration of a classic frame with an 11-bit id, s, interframe space included."""
    stuffable = 34 + 8 * n_bytes
    return (stuffable + 13 + (stuffable - 1) // 4) / bitrate


def fd_frame_s(n_bytes: int, bitrate: int, dbitrate: int) -> float:
    """Longest duration of an FD frame with an 11-bit id and bit-rate switch, s, interframe space included."""
    head, tail = 17, 12  # SOF..BRS; ACK, ACK delimiter, EOF, interframe space
    body = 5 + 8 * n_bytes  # ESI, DLC, data
    stuffed_all = (head + body - 1) // 4
    stuffed_head = (head - 1) // 4
    crc = 4 + (21 if n_bytes > 16 else 17)
    fixed = 1 + crc // 4
    fast = body + (stuffed_all - stuffed_head) + crc + fixed + 1  # 1: CRC delimiter
    return (head + stuffed_head + tail) / bitrate + fast / dbitrate


def serial_frame_s(n_bytes: int, baud: int) -> float:
    """Duration of a framed payload on a serial line, s."""
    return (n_bytes + SERIAL_OVERHEAD) * SERIAL_BITS / baud
