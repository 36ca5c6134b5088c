"""Fuzz target. Invariant: for any input, the decoders deliver only samples that were put in, and never raise
anything but VersionMismatch.

    python tests/fuzz/fuzz_decoder.py -max_total_time=60     coverage-guided, with atheris (x86-64)
    python tests/fuzz/fuzz_decoder.py --random 100000        random input, without atheris

The input is read as a script: a byte chooses what comes next (a good frame, the input's own bytes, a good
frame with bytes exchanged), so that the fuzzer reaches the code behind the CRCs. A damaged frame counts as
put in if its E2E check holds: that is the CRC's residual error (WIRE.md), which no decoder can detect. For
the same reason 8-byte parts made of the input's own bytes, and parts with any content and a right CRC, go to
a node whose samples are not checked.
"""

import sys
from contextlib import nullcontext, suppress
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

RANDOM = sys.argv[1:2] == ["--random"]
if not RANDOM:
    import atheris

with nullcontext() if RANDOM else atheris.instrument_imports(include=["hostlink"]):
    from hostlink.decoder import CanDecoder, Event, Sample, SerialDecoder
    from hostlink.errors import VersionMismatch
    from hostlink.wire import CorruptFrame, Message, State, encode_frame, pack_parts, pack_state, unpack_state
    from hostlink.wire.e2e import protect_p11
    from hostlink.wire.fields import DATA_ID_CLASSIC, PARTS

FORGED = 3
BASES = (0x180, 0x280, 0x380, 0x480, 0x580, 0x700, 0x080)


class Script:
    """Takes the input apart."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def take(self, n: int) -> bytes:
        """The next n bytes, zeros behind the end."""
        piece = self._data[self._at : self._at + n]
        self._at += n
        return piece.ljust(n, b"\0")

    def byte(self) -> int:
        return self.take(1)[0]

    @property
    def left(self) -> bool:
        return self._at < len(self._data)


def forged_part(script: Script) -> tuple[int, bytes]:
    """A classic part with a right CRC and any content: it reaches the reassembly."""
    part = PARTS[script.byte() % len(PARTS)]
    frame = bytearray(script.take(8))
    if part.page is not None:
        frame[2] = frame[2] & 0x1F | part.page << 5
    protect_p11(frame, frame[1], DATA_ID_CLASSIC | part.index)
    return 0x80 + 0x100 * part.tpdo + FORGED, bytes(frame)


def run(data: bytes) -> None:
    """One input. Raises AssertionError: the invariant does not hold."""
    script, can, serial = Script(data), CanDecoder(), SerialDecoder(1)
    allowed: set[str] = set()
    events: list[Event] = []
    number = 0
    while script.left:
        op = script.byte()
        number += 1 + op // 64
        state = State(sample=number & 0xFFFF, displacement_mm=op / 100)
        frame = bytearray(pack_state(state, number))
        if op % 8 >= 6:
            frame[script.byte() % len(frame)] ^= script.byte()
            frame[script.byte() % len(frame)] ^= script.byte()
        with suppress(CorruptFrame):  # damaged: it must not be delivered
            allowed.add(repr(unpack_state(bytes(frame))))
        try:
            match op % 8:
                case 0 | 6:
                    events += can.receive(0x181, bytes(frame))
                case 1 | 7:
                    events += serial.receive(encode_frame(Message.STATE, bytes(frame)))
                case 2:
                    for tpdo, part in pack_parts(state, number):
                        events += can.receive(0x80 + 0x100 * tpdo + 2, part)
                case 3:
                    base = BASES[script.byte() % len(BASES)]
                    size = script.byte() % 65
                    node = FORGED if size == 8 else 1 + script.byte() % 2
                    if size == 8 and op & 8:
                        events += can.receive(*forged_part(script))
                    else:
                        events += can.receive(base + node, script.take(size))
                case 4:
                    events += serial.receive(script.take(script.byte()))
                case 5:
                    body = script.take(script.byte() % 80)
                    events += serial.receive(encode_frame(Message(op // 8 % len(Message)), body))
        except VersionMismatch:
            continue
    for event in events:
        if isinstance(event, Sample) and event.node != FORGED:
            assert repr(event.state) in allowed, f"a sample that was never put in: {event}"


def main() -> None:
    """With --random N: N inputs from a fixed seed. Else: atheris."""
    if RANDOM:
        rng = Random(0)
        for _ in range(int(sys.argv[2])):
            run(rng.randbytes(rng.randrange(400)))
        return
    atheris.Setup(sys.argv, run)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
