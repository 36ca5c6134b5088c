"""E2E protection against published vectors, and the errors that it can and cannot find."""

from itertools import combinations

import pytest

from hostlink.wire.e2e import check_p5, check_p11, crc8, crc16, protect_p11, protected_p5
from hostlink.wire.generate.residual import undetected_p5, undetected_p11

# AUTOSAR, "Specification of CRC Routines": test vectors of CRC8 (SAE J1850) and CRC16 (CCITT-FALSE).
PUBLISHED = [
    ("00000000", 0x59, 0x84C0),
    ("F20183", 0x37, 0xD374),
    ("0FAA0055", 0x79, 0x2023),
    ("00FF5511", 0xB8, 0xB8F9),
    ("332255AABBCCDDEEFF", 0xCB, 0xF53F),
    ("926B55", 0x8C, 0x0745),
    ("FFFFFFFF", 0x74, 0x1D0F),
    (b"123456789".hex(), 0x4B, 0x29B1),
]


@pytest.mark.parametrize(("data", "eight", "sixteen"), PUBLISHED)
def test_crc_published(data: str, eight: int, sixteen: int) -> None:
    assert crc8(bytes.fromhex(data), 0xFF) ^ 0xFF == eight
    assert crc16(bytes.fromhex(data)) == sixteen


def test_profile_5_published() -> None:
    """AUTOSAR, "E2E Protocol Specification", profile 5: 8 zero bytes, data id 0x1234, counter 0."""
    frame = protected_p5(bytes(5), 0, 0x1234)
    assert frame.hex() == "1cca000000000000"
    assert check_p5(frame, 0x1234)
    assert not check_p5(frame, 0x1235)


def test_profile_11c_published() -> None:
    """Same source, profile 11, nibble mode: 8 zero bytes, data id 0x123, counter 0."""
    frame = bytearray(8)
    protect_p11(frame, 0, 0x123)
    assert frame.hex() == "2a10000000000000"
    assert check_p11(frame, 0x123)
    assert not check_p11(frame, 0x122)
    assert not check_p11(frame, 0x223)


def test_counter_15_is_never_valid() -> None:
    frame = bytearray(8)
    protect_p11(frame, 0, 0x100)
    frame[1] |= 0xF
    frame[0] = crc8(frame[1:], crc8(bytes((0, 0))))
    assert not check_p11(frame, 0x100)


def test_all_triple_flips_of_64_bytes_are_found() -> None:
    """Counted exactly, from the syndromes; the residual of four is that of WIRE.md."""
    share = undetected_p5()
    assert share[1] == share[2] == share[3] == 0
    assert share[4] == pytest.approx(2**-15, rel=0.05)


def test_the_residual_of_8_bytes_agrees_with_trying_them_all() -> None:
    share = undetected_p11()
    frame = bytearray(8)
    protect_p11(frame, 3, 0x1A0)
    passed = {1: 0, 2: 0, 3: 0}
    tried = dict.fromkeys(passed, 0)
    whole = int.from_bytes(frame, "little")
    nibbles = 0xFF << 8  # flips there are found by more than the CRC
    for n in passed:
        for bits in combinations(range(64), n):
            mask = sum(1 << bit for bit in bits)
            if mask & nibbles:
                continue
            tried[n] += 1
            passed[n] += check_p11((whole ^ mask).to_bytes(8, "little"), 0x1A0)
    assert passed[1] == passed[2] == 0 == share[1] == share[2]
    assert passed[3] / tried[3] == pytest.approx(share[3], rel=0.2)
