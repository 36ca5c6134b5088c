"""Residual error of the E2E checks: which bit flips pass, counted exactly from the CRC's linearity.

A set of flipped bits passes exactly when the syndromes of its bits (the CRC's answer to each bit alone)
cancel. So the numbers of undetected double, triple and quadruple flips follow from the table of
syndromes of pairs, without trying each.
"""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from math import comb
from typing import Final

from hostlink.wire.e2e import P5_HEADER, crc8, crc16
from hostlink.wire.fields import STATE_SIZE
from hostlink.wire.parts import PART_SIZE

__all__ = ["undetected", "undetected_p5", "undetected_p11"]

_ID: Final = bytes(2)  # the data id is not on the wire: none of its bits flips


def _syndromes_p5() -> list[int]:
    zero = crc16(bytes(STATE_SIZE - 2) + _ID)
    found = [1 << bit for bit in range(16)]  # of the CRC's own bits
    for bit in range(8 * (STATE_SIZE - 2)):
        data = bytearray(STATE_SIZE - 2)
        data[bit // 8] = 1 << bit % 8
        found.append(crc16(bytes(data) + _ID) ^ zero)
    assert P5_HEADER > 2
    return found


def _syndromes_p11() -> list[int]:
    found = [1 << bit for bit in range(8)]
    for bit in range(8 * (PART_SIZE - 1)):
        data = bytearray(PART_SIZE - 1)
        data[bit // 8] = 1 << bit % 8
        found.append(crc8(bytes(data)))
    return found


def undetected(syndromes: list[int]) -> dict[int, float]:
    """Flipped bits (1..4) -> share of all such patterns that pass."""
    n = len(syndromes)
    single = Counter(syndromes)
    pairs = Counter(a ^ b for a, b in combinations(syndromes, 2))
    triples = sum(count * pairs[value] for value, count in single.items())
    if pairs[0] == 0:  # all syndromes differ: each triple was counted three times, each quadruple three times
        triples //= 3
        quadruples = sum(count * (count - 1) // 2 for count in pairs.values()) // 3
    else:
        raise ValueError("double flips pass: the polynomial is too short for this frame")
    return {
        1: single[0] / n,
        2: pairs[0] / comb(n, 2),
        3: triples / comb(n, 3),
        4: quadruples / comb(n, 4),
    }


def undetected_p5() -> dict[int, float]:
    """Residual rates of the 64-byte frame."""
    return undetected(_syndromes_p5())


def undetected_p11() -> dict[int, float]:
    """Residual rates of a classic part."""
    return undetected(_syndromes_p11())
