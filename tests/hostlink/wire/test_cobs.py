"""COBS: published examples, and round trips without zero bytes."""

import pytest

from hostlink.wire import CorruptFrame
from hostlink.wire.cobs import decode, encode

# From the paper and the examples commonly given with it: long runs at and about the 254 limit.
CASES = [
    (b"", "01"),
    (b"\0", "0101"),
    (b"\0\0", "010101"),
    (b"\0\x11\0", "01021101"),
    (bytes.fromhex("11220033"), "0311220233"),
    (bytes.fromhex("11000000"), "0211010101"),
    (bytes(range(1, 255)), "ff" + bytes(range(1, 255)).hex()),
    (bytes(range(255)), "01ff" + bytes(range(1, 255)).hex()),
    (bytes(range(1, 256)), "ff" + bytes(range(1, 255)).hex() + "02ff"),
    (bytes(range(2, 256)) + b"\0", "ff" + bytes(range(2, 256)).hex() + "0101"),
    (bytes(range(3, 256)) + b"\0\1", "fe" + bytes(range(3, 256)).hex() + "0201"),
    (b"\1" * 508, "ff" + "01" * 254 + "ff" + "01" * 254),
]


@pytest.mark.parametrize(("plain", "stuffed"), CASES)
def test_published(plain: bytes, stuffed: str) -> None:
    assert encode(plain).hex() == stuffed
    assert decode(bytes.fromhex(stuffed)) == plain


@pytest.mark.parametrize("data", [b"\x05\x11", b"\0", b"\x02\0", b"\xff\x01"])
def test_damage_is_refused(data: bytes) -> None:
    with pytest.raises(CorruptFrame):
        decode(data)
