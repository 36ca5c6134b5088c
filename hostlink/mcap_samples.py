"""The samples in an MCAP recording, as `edge run --record` and `hostlink bridge --record` write them."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from math import nan
from pathlib import Path
from typing import Any

from hostlink.errors import LogError, UsageError
from hostlink.events import Sample
from hostlink.input_file import open_input
from hostlink.mcap_chunk import UNPACKED_MAX, unpack_chunk
from hostlink.wire.fields import FIELDS
from hostlink.wire.state import Contact, State
from hostlink.wire.status import Status

__all__ = ["MCAP_SUFFIX", "read_mcap"]

MCAP_SUFFIX = ".mcap"
_SAMPLES = re.compile(r"/finger_(\d{1,3})/sample")
_KINDS: dict[str, type] = {f.name: int if f.plain else float for f in FIELDS if f.name != "status"}


def read_mcap(path: Path) -> Iterator[Sample]:
    """The samples in order; `host_time_s` and `arrival_s` are when the image was taken.

    Raises  LogError: no such file, not MCAP, or damaged (after the samples before); UsageError: no library
    """
    try:
        from mcap.exceptions import InvalidMagic, McapError
        from mcap.records import Channel, Chunk, Message
        from mcap.stream_reader import StreamReader, breakup_chunk
        from zstandard import ZstdError
    except ImportError as error:
        raise UsageError(f"{path}: {error}; install voronoi-touch[edge] or -e .[edge]") from error
    broken = (McapError, ZstdError, struct.error, RuntimeError, LookupError, OverflowError, MemoryError)
    before: dict[int, int] = {}
    try:
        with open_input(path) as file:
            # Records come in the file's order, without its index: a truncated file has none.
            reader = StreamReader(file, emit_chunks=True, record_size_limit=UNPACKED_MAX)
            channels: dict[int, int] = {}
            for record in reader.records:
                for item in breakup_chunk(unpack_chunk(record)) if isinstance(record, Chunk) else [record]:
                    if isinstance(item, Channel) and (found := _SAMPLES.fullmatch(item.topic)):
                        channels[item.id] = int(found[1])
                    if isinstance(item, Message) and item.channel_id in channels:
                        finger, time_s = channels[item.channel_id], item.log_time * 1e-9
                        state = _state(dict(json.loads(item.data)["values"]))
                        lost_n = state.sample - before.get(finger, state.sample - 1) - 1 & 0xFFFF
                        before[finger] = state.sample
                        yield Sample(finger, state, time_s, nan, time_s, lost_n)
    except InvalidMagic:
        raise LogError(f"{path}: not an MCAP file; give what `edge run --record` wrote") from None
    except (*broken, ValueError, TypeError):
        when = "" if before else " before its first sample; copy or record it again"
        raise LogError(f"{path}: cut off or damaged{when}") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from None


def _state(values: dict[str, Any]) -> State:
    """Raises ValueError, LookupError, TypeError, OverflowError: it is no sample."""
    known: dict[str, Any] = {n: k(values[n]) for n, k in _KINDS.items() if values.get(n) is not None}
    rows = ([nan if x is None else float(x) for x in row] for row in values.get("contacts") or ())
    bits = (Status.__members__.get(name, Status(0)) for name in values.get("status") or ())
    return State(**known, status=Status(sum(set(bits))), contacts=tuple(Contact(*row) for row in rows))
