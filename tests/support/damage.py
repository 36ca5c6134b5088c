"""Files as a bad disk or an attacker leaves them."""

import struct
from random import Random


def damaged(dice: Random, data: bytes) -> bytes:
    """Bits flipped, lengths replaced, pieces removed, doubled or exchanged."""
    changed = bytearray(data)
    lengths = [0, 1, 8, 0x7F, 0xFF, 1 << 16, (1 << 31) - 1, 1 << 31, 1 << 33, 1 << 62, (1 << 64) - 1]
    for _ in range(dice.choice([1, 1, 2, 5, 20])):
        at = dice.randrange(len(changed))
        what = dice.randrange(6)
        if what == 0:
            changed[at] ^= 1 << dice.randrange(8)
        elif what == 1:
            changed[at : at + 8] = struct.pack("<Q", dice.choice(lengths))
        elif what == 2:
            changed[at : at + 4] = struct.pack("<I", dice.choice(lengths) & 0xFFFFFFFF)
        elif what == 3:
            del changed[at : at + dice.randrange(1, 64)]
        elif what == 4:
            changed[at:at] = changed[at : at + dice.randrange(1, 64)]
        else:
            other = dice.randrange(len(changed))
            changed[at : at + 9] = changed[other : other + 9]
        if not changed:
            changed = bytearray(data)
    return bytes(changed)
