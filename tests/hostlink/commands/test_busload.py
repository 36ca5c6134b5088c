"""Bus load: published figures, and advice that holds."""

import pytest

from hostlink.commands.busload import LIMIT, plan
from hostlink.wire import State, encode_frame, pack_state
from hostlink.wire.serial import Message
from hostlink.wire.timing import SERIAL_OVERHEAD, classic_frame_s, fd_frame_s, serial_frame_s


def test_frame_times_with_worst_case_stuffing() -> None:
    assert classic_frame_s(8, 1_000_000) == pytest.approx(135e-6)
    assert fd_frame_s(64, 1_000_000, 5_000_000) == pytest.approx(168.8e-6)
    assert fd_frame_s(64, 500_000, 2_000_000) == pytest.approx(405.5e-6)


def test_classic_stuffing_against_a_bitwise_count() -> None:
    """The worst payload, stuffed bit by bit, is never longer than by the formula."""
    for n in range(9):
        stuffable = 34 + 8 * n
        bits, run, out, level = [i // 4 % 2 for i in range(stuffable)], 0, 0, -1
        for bit in [0, *bits[: stuffable - 1]]:
            run = run + 1 if bit == level else 1
            level, out = bit, out + 1
            if run == 5:
                out, level, run = out + 1, 1 - level, 1
        assert out + 13 <= round(classic_frame_s(n, 1_000_000) * 1e6)


def test_serial_time_is_the_frames_bytes() -> None:
    frame = encode_frame(Message.STATE, pack_state(State(sample=5), 0))
    assert len(frame) == 64 + SERIAL_OVERHEAD
    assert serial_frame_s(64, 921_600) == pytest.approx(len(frame) * 10 / 921_600)


@pytest.mark.parametrize("kind", ["fd", "classic", "serial"])
@pytest.mark.parametrize("fingers", [1, 5, 20])
@pytest.mark.parametrize("rate", [100, 250, 1000])
def test_advice_holds(kind: str, fingers: int, rate: float) -> None:
    slow = 115_200 if kind == "serial" else 500_000
    load = plan(kind, fingers, rate, slow, 2_000_000 if kind == "fd" else None)
    assert load.fits == (load.share <= LIMIT)
    assert bool(load.advice) != load.fits
    for advice in load.advice:
        words = advice.split()
        if advice.endswith("as it is"):
            fits = plan(kind, fingers, float(words[0]), slow, load.dbitrate)
            assert fits.fits
            assert not plan(kind, fingers, float(words[0]) + 1, slow, load.dbitrate).fits
        elif "fingers a bus" in advice:
            assert plan(kind, int(words[0]), rate, slow, load.dbitrate).fits
            assert not plan(kind, int(words[0]) + 1, rate, slow, load.dbitrate).fits
        elif advice.endswith("baud"):
            assert plan(kind, fingers, rate, int(words[0])).fits
        else:
            rates = [round(float(r) * 1e6) for r in words[-2].split("/")]
            assert plan("fd" if "FD" in advice else "classic", fingers, rate, rates[0], rates[-1]).fits
