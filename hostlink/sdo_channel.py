"""One node's SDO channel as one of its clients hears it: whose is an answer? No I/O, no clock.

CANopen gives a channel to one client, so that an answer names no client. But hosts on one bus hear each
other's requests, and a server answers one request after the other:

    a request heard before ours was sent     the first answer that fits it is theirs
    the same request as ours, meanwhile      the second answer holds for both
    another one that the answer fits too     nobody can tell whose it is: ours is made once more
    another's segment within our transfer    it begins anew: segments are alike, whatever they are of
    another's block transfer                 all answers are its own, and the server hears nobody else

`SdoObjects` waits and repeats; a node answers a repeated request as before, and does nothing twice.
"""

from __future__ import annotations

from enum import Enum, auto

from hostlink.wire.objects import Abort
from hostlink.wire.sdo import (
    ANSWER_TO,
    BLOCKS,
    EXPEDITED,
    LAST,
    NAMELESS,
    SEGMENTS,
    SPECIFIER,
    TOGGLE,
    Block,
    Sdo,
    goes_on,
)

__all__ = ["SdoChannel", "Whose"]

_NO_TRANSFER = bytes((Sdo.ABORT,)) + NAMELESS  # none is under way: a segment fits nothing
_OUT_OF_STEP = Abort.TOGGLE.to_bytes(4, "little")  # answers a segment, even where it names our object
HELD_MAX = 64  # requests of others that wait for an answer; more are a flood


class Whose(Enum):
    """Whose an answer is."""

    OURS = auto()
    ANOTHERS = auto()
    UNCLEAR = auto()


class SdoChannel:
    """The request that is not answered yet.

    idle_s   after this without a word others' requests and transfers count as abandoned
    grace_s  the same for a transfer without a segment so far
    """

    def __init__(self, idle_s: float, grace_s: float) -> None:
        self._idle_s, self._grace_s = idle_s, grace_s
        self._ours = b""
        self._object = b""  # index and sub-index of our transfer
        self._disturbed = False  # another's segment was heard in it
        self._before: list[tuple[float, bytes]] = []  # others' requests, heard before ours was sent
        self._meanwhile: list[tuple[float, bytes]] = []
        self._theirs = b""  # object of another's segmented transfer
        self._moved = False
        self._block = 0  # specifier of another's block transfer
        self._last_s = 0.0

    def ask(self, request: bytes, now_s: float) -> bool:
        """We send this. False: no, for our transfer is disturbed."""
        if _is_segment(request):
            if self._disturbed:
                return False
        else:
            self._object = request[1:4]
        self._before = [item for item in self._before + self._meanwhile if now_s - item[0] < self._idle_s]
        self._meanwhile = []
        self._ours = request
        if not self.blocked_s(now_s):
            self._block = 0
        return True

    def overhear(self, request: bytes, now_s: float) -> None:
        """Another client sends this."""
        self._last_s = now_s
        if goes_on(request[0]) and request[0] & SPECIFIER == Sdo.BLOCK_UPLOAD:
            self._block = Sdo.BLOCK_UPLOAD
        if self._block:
            if request[0] in (Sdo.ABORT, Sdo.BLOCK_UPLOAD | Block.END):
                self._ended()
            return
        if request[0] & SPECIFIER == Sdo.ABORT:
            self._ended()
        elif len(self._meanwhile) < HELD_MAX:
            self._meanwhile.append((now_s, request))
        if _is_segment(request):
            self._moved = self._disturbed = True

    def busy_s(self, what: bytes, now_s: float) -> float:
        """How long another's transfer of this object may still take without a word; 0: there is none."""
        if what != self._theirs:
            return 0.0
        return self._last_s + (self._idle_s if self._moved else self._grace_s) - now_s

    def blocked_s(self, now_s: float) -> float:
        """How long another's block transfer may still take without a word; 0: there is none."""
        return max(0.0, self._last_s + self._idle_s - now_s) if self._block else 0.0

    def unanswered_s(self, now_s: float) -> float:
        """How long others' requests may still wait for their answers; 0: there are none."""
        return max((at_s + self._idle_s - now_s for at_s, _ in self._before + self._meanwhile), default=0.0)

    def answer(self, data: bytes) -> Whose:
        """The server sends this."""
        if self._block:
            last = Sdo.BLOCK_UPLOAD | Block.END  # the server's, of a download, is the same number
            if data[0] == Sdo.ABORT or (self._block == Sdo.BLOCK_DOWNLOAD and data[0] == last):
                self._ended()
            return Whose.ANOTHERS
        ours = self._ours if self._ours and _fits(data, self._ours, self._object) else b""
        if ours and data[:4] == _NO_TRANSFER:
            self._ours = b""
            self._ended()
            return Whose.OURS
        meanwhile = [item for item in self._meanwhile if _fits(data, item[1], self._theirs)]
        for item in self._before:
            if _fits(data, item[1], self._theirs):
                self._before.remove(item)
                return self._anothers(item[1], data)
        for item in meanwhile:
            if not ours or item[1] == ours:
                self._meanwhile.remove(item)
                return self._anothers(item[1], data)
        if not ours:
            return Whose.ANOTHERS
        self._ours = b""
        if _starts(ours, data):
            self._disturbed = any(_is_segment(request) for _, request in self._before + self._meanwhile)
        if meanwhile:  # one of several answers is gone; the others' number is right
            self._before += self._meanwhile
            self._meanwhile = []
            return Whose.UNCLEAR
        return Whose.OURS

    def _anothers(self, request: bytes, answer: bytes) -> Whose:
        """Follow the transfer that an answer belongs to."""
        if _is_segment(request):
            last = request if request[0] & SPECIFIER == Sdo.DOWNLOAD_SEGMENT else answer
            if answer[0] == Sdo.ABORT or last[0] & LAST:
                self._ended()
        elif request[0] & SPECIFIER in BLOCKS:
            self._block = request[0] & SPECIFIER if answer[0] != Sdo.ABORT else 0
        elif _starts(request, answer):
            self._theirs, self._moved = request[1:4], False
        return Whose.ANOTHERS

    def _ended(self) -> None:
        """Another's transfer is over; no segment of it will be answered any more."""
        if self._block:  # whatever was asked meanwhile
            self._before, self._meanwhile = [], []
        self._theirs, self._block = b"", 0
        self._before = [item for item in self._before if not _is_segment(item[1])]
        self._meanwhile = [item for item in self._meanwhile if not _is_segment(item[1])]


def _is_segment(request: bytes) -> bool:
    return request[0] & SPECIFIER in SEGMENTS


def _starts(request: bytes, answer: bytes) -> bool:
    """Whether a segmented transfer begins with this."""
    if answer[0] == Sdo.ABORT or _is_segment(request):
        return False
    return not (answer if request[0] & SPECIFIER == Sdo.UPLOAD else request)[0] & EXPEDITED


def _fits(answer: bytes, request: bytes, transferred: bytes) -> bool:
    """Whether this may be the answer to a request; `transferred`: the object that its segments belong to."""
    objects = (transferred, NAMELESS) if _is_segment(request) else (request[1:4],)
    if answer[0] & SPECIFIER == Sdo.ABORT:
        return answer[1:4] in objects and (_is_segment(request) or answer[4:] != _OUT_OF_STEP)
    if answer[0] & SPECIFIER != ANSWER_TO.get(request[0] & SPECIFIER):
        return False
    if _is_segment(request):
        return not (answer[0] ^ request[0]) & TOGGLE
    return answer[1:4] in objects
