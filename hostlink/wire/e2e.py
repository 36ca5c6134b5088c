"""End-to-end protection: AUTOSAR E2E profile 5 (frames of 64 bytes, serial) and 11C (8 bytes).

Profile 5    byte 0..1 CRC-16 (little-endian), byte 2 counter 0..255, then data.
             CRC-16/CCITT-FALSE over bytes 2.. and then the implicit data id, low byte first.
Profile 11C  byte 0 CRC-8, byte 1 counter 0..14 (low nibble) and the data id's bits 8..11 (high nibble).
             CRC-8 SAE J1850 over data id's low byte, a zero byte, and then bytes 1.. .

Source: AUTOSAR, "E2E Protocol Specification" (PRS_E2EProtocol), profiles 5 and 11 ("nibble" mode).

The data id is never sent (except for that nibble): it is a hash of the schema, so that a frame of another
layout has a wrong CRC here. `implied_id_*` inverts that: which data id would make this frame valid? Noise
implies a different id in each frame; another version implies the same id again and again, and so the
decoder distinguishes the two.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Final

__all__ = [
    "P5_COUNTERS",
    "P5_HEADER",
    "P11_COUNTERS",
    "P11_HEADER",
    "check_p5",
    "check_p11",
    "crc8",
    "crc16",
    "implied_id_p5",
    "implied_id_p11",
    "protect_p11",
    "protected_p5",
]

P5_HEADER: Final = 3  # bytes: CRC, counter
P5_COUNTERS: Final = 256  # 0..255
P11_HEADER: Final = 2  # bytes: CRC, counter and nibble
P11_COUNTERS: Final = 15  # 0..14; 15 is "no data yet" in AUTOSAR's receivers

CRC16_POLYNOMIAL: Final = 0x1021
CRC8_POLYNOMIAL: Final = 0x1D


def _crc8_byte(register: int) -> int:
    for _ in range(8):
        register = (register << 1) ^ (CRC8_POLYNOMIAL if register & 0x80 else 0)
        register &= 0xFF
    return register


_CRC8: Final = bytes(_crc8_byte(i) for i in range(256))
_CRC8_INVERSE: Final = bytes(_CRC8.index(i) for i in range(256))


def crc16(data: bytes | bytearray, start: int = 0xFFFF) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, not reflected; `123456789` gives 0x29B1."""
    return crc_hqx(data, start)


def crc8(data: bytes | bytearray, start: int = 0x00) -> int:
    """Register of the CRC-8 with polynomial 0x1D, not reflected.

    CRC-8/SAE-J1850 (`123456789` gives 0x4B) is this with start 0xFF and the result inverted. Profile 11
    calls it such that both inversions cancel, which leaves start 0 and no inversion.
    """
    register = start
    for byte in data:
        register = _CRC8[register ^ byte]
    return register


def protected_p5(data: bytes, counter: int, data_id: int) -> bytes:
    """The frame of this data: behind its 3-byte header."""
    counted = bytes((counter & 0xFF,)) + data
    crc = crc_hqx(data_id.to_bytes(2, "little"), crc_hqx(counted, 0xFFFF))
    return crc.to_bytes(2, "little") + counted


def check_p5(frame: bytes | bytearray, data_id: int) -> bool:
    """Whether the CRC is right for this data id."""
    crc = crc_hqx(data_id.to_bytes(2, "little"), crc_hqx(frame[2:], 0xFFFF))
    return len(frame) > P5_HEADER and crc == frame[0] | frame[1] << 8


def implied_id_p5(frame: bytes) -> int:
    """The only data id with which `check_p5` would hold: the CRC register run backwards over 16 bits."""
    register = frame[0] | frame[1] << 8
    for _ in range(16):
        register = (register ^ CRC16_POLYNOMIAL) >> 1 | 0x8000 if register & 1 else register >> 1
    swapped = register ^ crc_hqx(frame[2:], 0xFFFF)
    return (swapped & 0xFF) << 8 | swapped >> 8


def protect_p11(frame: bytearray, counter: int, data_id: int) -> None:
    """Fill in the 2-byte header of `frame` in place; counter is taken modulo 15."""
    frame[1] = counter % P11_COUNTERS | data_id >> 4 & 0xF0
    frame[0] = crc8(frame[1:], _CRC8[_CRC8[data_id & 0xFF]])


def check_p11(frame: bytes | bytearray, data_id: int) -> bool:
    """Whether CRC, nibble and counter are right for this 12-bit data id."""
    return (
        len(frame) > P11_HEADER
        and frame[1] >> 4 == data_id >> 8 & 0xF
        and frame[1] & 0xF < P11_COUNTERS
        and frame[0] == crc8(frame[1:], _CRC8[_CRC8[data_id & 0xFF]])
    )


def implied_id_p11(frame: bytes) -> int:
    """The one 12-bit data id with which `check_p11` would hold (given a counter below 15)."""
    register = frame[0]
    for byte in reversed(frame[1:]):
        register = _CRC8_INVERSE[register] ^ byte
    low = _CRC8_INVERSE[_CRC8_INVERSE[register]]
    return (frame[1] >> 4) << 8 | low
