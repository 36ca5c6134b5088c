"""WIRE.md: layout, fields, protection, identifiers, objects and faults, for who implements the other end."""
# ruff: noqa: E501 - the document's own lines and rows stay whole

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from cantools.database.can import Signal

from hostlink.wire.canid import CanIds
from hostlink.wire.fields import (
    CHECK_SIZE,
    CLASSIC_BITS,
    DATA_ID,
    DATA_ID_CLASSIC,
    LAYOUT,
    PARTS,
    SCHEMA_HASH,
    STATE_SIZE,
    VERSION,
    field_named,
)
from hostlink.wire.generate.dbc import classic_signals, state_signals
from hostlink.wire.generate.residual import undetected_p5, undetected_p11
from hostlink.wire.objects import (
    ABORTS,
    FRAME_INDEX,
    OBJECTS,
    REST_FRAME_REASONS,
    REST_FRAME_STATES,
    SAMPLE_INDEX,
)
from hostlink.wire.process_data import MAPPING, SAMPLE_DATA
from hostlink.wire.serial import BODY_MAX, CHUNK_MAX, Message
from hostlink.wire.status import FAULTS, NO_CONTROL, STATUS

__all__ = ["markdown"]

_WHY: Final = (
    ("One frame of 64 bytes, not several", "it is the largest CAN FD frame: a sample is whole or not there, "
     "and a controller never sees half of one"),
    ("Fixed-point integers", "a controller without a floating-point unit reads them; the step is finer than "
     "the sensor's noise, so nothing is lost"),
    ("NaN is one raw value", "an invalid value cannot be mistaken for zero. The DBC names it `invalid`, and "
     "the C codec's `_is_in_range` is false for it"),
    ("Saturation", "a value that wraps reverses its sign; one at the range's end is wrong in size only, and a "
     "status bit marks it"),
    ("CRC and counter first", "E2E profile 5 has them there, and the first four bytes never move, so that "
     "every version can tell the version of every other"),
    ("The data id is a hash of the tables", "a frame of another layout has a wrong CRC: it cannot be decoded by "
     "accident, even when someone forgot to raise the version"),
    ("Capture time, not sending time", "control needs the age of what was seen; the latency says the rest"),
    ("Sample number beside the counter", "the counter tells losses on the link, the sample number survives "
     "long gaps and joins state, detail stream and classic parts"),
    ("Counter and sample number in every classic part", "with them no receiver ever joins two samples"),
    ("Displacement, shear and status in the first two classic messages", "a grasp controller needs no others, "
     "and no reassembly"),
    ("Classic pages only where a value is valid", "a bus of five fingers at 1 Mbit/s has no room for pages of "
     "invalid values"),
    ("A CRC-32 on serial lines only", "CAN's controllers check and repeat frames below ours; a bare line does "
     "not"),
    ("Little-endian", "as CANopen has it"),
    ("No compression, no optional fields in the state frame", "a receive interrupt reads it with fixed "
     "offsets"),
)  # fmt: skip


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return [*lines, ""]


def _number(value: float) -> str:
    return f"{value:.6g}"


def _byte_map(signals: list[Signal], size: int, width: int = 8) -> list[str]:
    """ASCII picture, `width` bytes a line; a name is cut where its cell is too narrow."""
    owner = ["?"] * size
    for s in signals:
        for byte in range(s.start // 8, (s.start + s.length + 7) // 8):
            owner[byte] = s.name
    cell = 11
    rule = "      +" + "+".join("-" * cell for _ in range(width)) + "+"
    lines = ["       " + " ".join(f"+{i}".center(cell) for i in range(width)), rule]
    for row in range(0, size, width):
        line, at = f"{row:5d} |", row
        while at < min(row + width, size):
            end = at
            while end < min(row + width, size) and owner[end] == owner[at]:
                end += 1
            room = (end - at) * (cell + 1) - 1
            begun = at > 0 and owner[at - 1] == owner[at]
            line += ("" if begun else owner[at])[:room].center(room) + "|"
            at = end
        lines += [line, rule]
    return ["```", *lines, "```", ""]


def _bit_rows(signals: list[Signal]) -> list[Sequence[object]]:
    return [_bit_row(s) for s in signals]


def _bit_row(s: Signal) -> Sequence[object]:
    invalid = next(iter(s.choices or ()), None)  # the only choice that a field has
    return (
        *(s.multiplexer_ids or ("",)),
        s.start,
        s.length,
        f"`{s.name}`",
        "" if invalid is None else _number(float(s.scale)),
        s.unit or "",
        "" if invalid is None else invalid,
        s.comment,
    )


def _state() -> list[str]:
    rows, at = [], 4
    for f in LAYOUT:
        kind = ("i" if f.signed else "u") + str(8 * f.size)
        nan = "" if f.plain else f.raw_nan(8 * f.size)
        span = f"{_number(f.low)} .. {_number(f.high)}" if not f.plain else f"0 .. {_number(f.high)}"
        rows.append(
            (
                at,
                f"`{f.name}`",
                kind,
                _number(f.scale) if f.scale else "",
                f.unit,
                span,
                nan,
                f.meaning,
                f.why,
            )
        )
        at += f.size
    assert at == STATE_SIZE - CHECK_SIZE
    rows.append(
        (
            at,
            "`check`",
            "u16",
            "",
            "",
            "",
            "",
            "low half of the CRC-32 (zlib) over bytes 3..61",
            "see Protection",
        )
    )
    return [
        "## State frame",
        "",
        f"{STATE_SIZE} bytes, little-endian; on CAN FD under identifier 0x180 + node, on serial lines as type 0.",
        "`value = raw * scale`; a raw value equal to `invalid` means not measured, not calibrated, not asked",
        "for or not to be trusted. A sigma that is more than 0 is sent as one step at least. Frame of reference",
        "`tip`: mm, x right and y down in the camera's image, origin on the tip's axis, z out of the skin.",
        "",
        *_byte_map(state_signals(), STATE_SIZE),
        *_table(("byte", "field", "type", "scale", "unit", "range", "invalid", "meaning", "why"), rows),
    ]


def _receiver() -> list[str]:
    return [
        "## Rules for a receiver that moves a hand",
        "",
        "1. *Check* each frame: CRC, version and `check`; a damaged one is as good as none.",
        "2. *Order*: a frame whose counter is that of the last one is a repetition.",
        "3. *Status*: a sample with one of the `NO_CONTROL` bits must not move anything.",
        "4. *Invalid* is not zero and not the value before: test each value that you use, and its sigma. With",
        "   SATURATED, a value may be the wrong end of its range; its sigma is then large.",
        "5. *Silence*: what was felt last is not what is felt now. Note when each sample came; after five periods",
        "   without one nothing is known, and the hand stops.",
        "",
        "docs/robot.md has the loop that does this in Python, docs/firmware.md the one in C; a test runs both.",
        "",
    ]


def _classic() -> list[str]:
    lines = [
        "## Classic CAN",
        "",
        "The same sample in 4 to 12 messages of 8 bytes, in this order, on the identifiers of TPDO1..4 (in the",
        "DBC: Part1..Part4). TPDO1 and TPDO2 are enough to control a grasp: depth and shear, and the status that",
        "says whether they may move a hand; without the sigma, a SATURATED depth is not known. They are of one",
        "sample where `counter` and `sample_low` agree.",
        "TPDO3 and TPDO4 are multiplexed by `page`; pages that are not sent hold invalid values only. `part_n`",
        "says how many messages the sample has.",
        "",
    ]
    rows = [
        (p.index, f"TPDO{p.tpdo}", "" if p.page is None else p.page, "always" if p.always else "if one is valid",
         ", ".join(f"`{name}`" for name in p.fields), f"0x{DATA_ID_CLASSIC | p.index:03X}")
        for p in PARTS
    ]  # fmt: skip
    lines += _table(("part", "on", "page", "sent", "fields", "data id"), rows)
    lines += [
        "A receiver joins parts of ascending index whose `counter` and `sample_low` agree, begins anew at",
        "part 0 and delivers when `part_n` messages came. The two together repeat after 480 samples.",
        "The full sample number is `sample_high << 5 | sample_low`. In standard receivers each page is a",
        "protected message of its own, with the data id above.",
        "",
    ]
    for tpdo in range(1, 5):
        lines += [f"### TPDO{tpdo}", ""]
        lines += _table(
            ("page", "bit", "bits", "signal", "scale", "unit", "invalid", "meaning"),
            _bit_rows(classic_signals(tpdo)),
        )
    return lines


def _protection() -> list[str]:
    p5, p11 = undetected_p5(), undetected_p11()
    block = STATE_SIZE + 8  # type, CRC-32, COBS and the separators
    damaged_hz = 921_600 / (10 * block) * (8 * block * 1e-6)
    years = 1 / (damaged_hz * 2**-47 * 365 * 86400)
    rows: list[Sequence[object]] = [
        (flips, f"{p5[flips]:.3g}" if p5[flips] else "0", f"{p11[flips]:.3g}" if p11[flips] else "0")
        for flips in p5
    ]
    rows.append(("5 and more, odd", "0", f"{2**-8:.3g}"))
    rows.append(("6 and more, even; bursts > 16 (8)", f"{2**-15:.3g} (bursts: {2**-16:.3g})", f"{2**-8:.3g}"))
    return [
        "## Protection",
        "",
        "AUTOSAR E2E profile 5 on frames of 64 bytes and on all serial frames: CRC-16/CCITT-FALSE (polynomial",
        "0x1021, start 0xFFFF) over bytes 2.. and then the data id, low byte first, which is not sent. Profile",
        "11C on classic parts: CRC-8 (polynomial 0x1D) over the data id's low byte, a zero byte and bytes 1.. ;",
        "the data id's upper nibble, the version, is sent.",
        "",
        *_table(
            ("frame", "data id"),
            [
                ("state", f"0x{DATA_ID:04X}"),
                *((f"serial type {m.value}, {m.name}", f"0x{DATA_ID + m & 0xFFFF:04X}") for m in Message),
                ("classic part i", f"0x{DATA_ID_CLASSIC:03X} + i"),
            ],
        ),
        "### Residual error probability",
        "",
        "Share of patterns of flipped bits, anywhere in the frame, that the E2E CRC alone lets pass. One to four",
        "flips are counted exactly: a CRC is linear, so a pattern passes when the syndromes of its bits cancel,",
        "and pairs of equal sum count the quadruples. Above, the share is that of a random CRC; the polynomial",
        "0x11021 has the factor x + 1, so that every odd number of flips is found.",
        "",
        *_table(("flipped bits", "64 bytes, profile 5", "8 bytes, profile 11C"), rows),
        "So the CRC-16 alone would let one in about 33000 of the frames with 4, 6 or 8 flips pass, and the CRC-8",
        "alone one in 200 to 260 of the parts with 3 and more. Neither ever stands alone:",
        "",
        "- *`check`* in the state frame is 16 bits of another, independent CRC: of the damaged frames that the",
        f"  CRC-16 lets pass it lets one in 65536 pass, {2**-31:.1g} of all with an even number of flips. Classic",
        "  samples carry 8 bits of it, over the sample as put together. Detail segments have none.",
        "- *CAN* adds the controllers' CRC-15 (classic), CRC-17 or CRC-21 (FD, with counted stuff bits), bit",
        "  monitoring and repetition. Of damaged frames at most 4.7e-11 (Bosch, CAN Specification 2.0) reach the",
        "  software. E2E is there for what CAN cannot see: memory, drivers, gateways, another sender on the same",
        f"  identifier. With both, an undetected error has 4.7e-11 * {2**-15:.2g} = {4.7e-11 * 2**-15:.1g} of the",
        f"  rate of damaged frames, in classic parts 4.7e-11 * {p11[3]:.2g} = {4.7e-11 * p11[3]:.1g}.",
        "- *Serial* adds a CRC-32 over type and payload. Its polynomial finds all patterns of up to 4 flips at",
        "  this length (Koopman, DSN 2002). For what is left: 2^-32 * 2^-15 =",
        f"  {2**-47:.1g} of the damaged frames. A 921600 baud line with a bit error rate of 1e-6, full of state",
        f"  frames, has {damaged_hz:.1g} damaged frames a second: an undetected one in {years:.0e} years.",
        "",
        "The counter finds what a CRC cannot, as the frame itself is intact: loss, repetition, insertion, wrong",
        "order. A late frame passes only if its 8-bit counter and its 16-bit sample number both look new: after",
        "32768 samples (2.3 minutes at 240 Hz) of delay. A frame of another type, part or version must have the",
        "right CRC by chance: 2^-16, or 2^-8 in classic parts (of the same node: identifiers differ).",
        "",
        *_unprotected(),
    ]


def _unprotected() -> list[str]:
    """The faults that the protection does not see, and how another version shows."""
    return [
        "### What is not seen",
        "",
        "- *The node.* It is in the identifier, not in the data id: a whole frame of finger 1 under finger 2's",
        "  identifier is finger 2's for a receiver. The controllers' CRCs cover the identifier, so that noise does",
        "  not do this; a gateway that maps identifiers wrongly does. Two senders with one number are seen: their",
        "  sample numbers and capture times interleave (`second_sender_n` of the host library).",
        "- *Intent.* CRCs are no signatures. Whoever can send on the bus can send samples in a finger's name, and",
        "  repeat old ones. The host library drops frames that are older than the newest; it believes a restart",
        "  after 8 frames of another sequence without one of the known between, or after a boot-up",
        "  message. So a few old frames are not delivered, a longer replay while the finger is silent is.",
        "",
        "### Another version",
        "",
        "The host library decodes version 2, too; the C files read the version that they were made for alone.",
        "",
        "A receiver tells it from noise so: for each frame with a wrong CRC there is exactly one data id that",
        "would make it right. Noise implies another one each time; three different frames that imply the same",
        "one, with the same version byte, are another version (chance of noise: 2^-48). On classic CAN, where a",
        "part implies 12 bits of data id and version, it takes six different TPDO1 (2^-60). The error names both",
        "versions. A single frame whose CRC is right for our data id and whose version byte is not ours is noise.",
        "",
    ]


def _serial() -> list[str]:
    return [
        "## Serial lines",
        "",
        "```",
        "0x00 | COBS( type 1 | payload | CRC-32 4 ) | 0x00",
        "payload = CRC-16 2 | counter 1 | version 1 | body          (type 0, 1: the CAN FD frame as it is)",
        "```",
        "",
        f"Bodies of at most {BODY_MAX} bytes. CRC-32 as in zlib, over type and payload, little-endian.",
        "",
        *_table(
            ("type", "name", "direction", "body"),
            [
                (0, "STATE", "to host", "as above"),
                (1, "DETAIL", "to host", "as below"),
                (2, "REQUEST", "to node", "op 1 (1 read, 2 write), index 2, sub 1, offset 4, total 4, data"),
                (3, "REPLY", "to host", "index 2, sub 1, abort 4, offset 4, total 4, data; counter as the request's"),
                (4, "HEARTBEAT", "to host", "NMT state 1"),
                (5, "EMERGENCY", "to host", "as on CAN"),
                (6, "NMT", "to node", "NMT command 1: 1 start, 2 stop, 128 pre-operational, 129 reset node, 130 "
                 "reset communication"),
                (7, "SYNC", "to node", "empty"),
            ],
        ),
        f"Objects longer than {CHUNK_MAX} bytes go in segments by offset; a write takes effect with its last one,",
        "when offset + length = total. Every request may be repeated.",
        "",
    ]  # fmt: skip


def _detail() -> list[str]:
    return [
        "## Detail stream",
        "",
        "Every pin's displacement and relative area change; off by default (object `detail_divider`). Segments",
        "of 64 bytes with 12 pins each, on CAN FD under 0x480 + node, on serial lines as type 1:",
        "",
        "```",
        "0        2      3       4        6         7           8      10                          64",
        "+--------+------+-------+--------+---------+-----------+------+---------------------------+",
        "| CRC-16 | cntr | versn | sample | segment | segment_n | pins | 12 x (dx 14, dy 14, da 8) |",
        "+--------+------+-------+--------+---------+-----------+------+---------------------------+",
        "```",
        "",
        "dx, dy in steps of 0.02 px, da in steps of 0.01; the most negative value is a lost pin. Segment k holds",
        "pins 12 k and on. The counter counts segments. It yields to the state frames whenever the bus is short.",
        "",
    ]


def _canopen() -> list[str]:
    ids = CanIds()
    objects = [
        (f"0x{o.index:04X}", o.sub, f"`{o.name}`", o.type, o.access + (", stored" if o.stored else ""),
         "" if o.default is None else (f"0x{o.default:X} + node" if o.node_id and isinstance(o.default, int) else o.default), o.unit, o.meaning)
        for o in OBJECTS
        if o.index < SAMPLE_INDEX and not (0x1A00 <= o.index < 0x1B00 and o.sub)
    ]  # fmt: skip
    return [
        "## Identifiers",
        "",
        "CiA 301's, all bases can be moved in the configuration of both ends.",
        "",
        *_table(
            ("identifier", "what"),
            [
                (f"0x{ids.nmt:03X}", "NMT commands, accepted"),
                (
                    f"0x{ids.sync:03X}",
                    "SYNC, accepted: latches a sample where `tpdo1_transmission` is 1..240",
                ),
                (f"0x{ids.emergency:03X} + node", "EMCY"),
                (f"0x{ids.tpdo1:03X} + node", "state frame (FD) or TPDO1 (classic)"),
                (f"0x{ids.tpdo2:03X} + node", "TPDO2 (classic)"),
                (f"0x{ids.tpdo3:03X} + node", "parts on TPDO3 (classic)"),
                (f"0x{ids.tpdo4:03X} + node", "detail stream (FD) or parts on TPDO4 (classic)"),
                (f"0x{ids.sdo_response:03X} + node", "SDO, node to host"),
                (f"0x{ids.sdo_request:03X} + node", "SDO, host to node"),
                (f"0x{ids.heartbeat:03X} + node", "heartbeat"),
            ],
        ),
        "EMCY: bytes 0..1 code, 2 error register, 3 fault (table below), 4..5 status bits, 6..7 zero.",
        "",
        "## Objects",
        "",
        "Over SDO and over serial requests alike.",
        "",
        *_table(("index", "sub", "name", "type", "access", "default", "unit", "meaning"), objects),
        *_process_data(),
        "Abort codes:",
        "",
        *_table(("code", "meaning"), [(f"0x{code:08X}", text) for code, text in ABORTS.items()]),
        *_several_hosts(),
        *_rest_frame(),
    ]


def _process_data() -> list[str]:
    rows = [
        (i, f"`{d.name}`", d.type, f"{d.low} to {d.high}", f"{d.scale:g} {d.unit}".rstrip())
        for i, d in enumerate(SAMPLE_DATA, 1)
    ]
    mapped = [
        (f"TPDO{tpdo}", ", ".join(f"`{name}` {bits}" for name, bits in entries))
        for tpdo, entries in MAPPING.items()
    ]
    return [
        "### Process data",
        "",
        f"Object 0x{SAMPLE_INDEX:X} is the newest sample, by SDO at any time: sub-index 1 is its first field, and so on, in",
        "the order of the state frame. Values are whole numbers of steps; one beyond its limits is not valid. Two reads may be",
        "of two samples: those that must belong together are read between two reads of `sample` that agree.",
        "",
        *_table(("sub", "name", "type", "valid", "step"), rows),
        f"On classic CAN the TPDOs are mapped as they are sent, bits behind each name; what begins with `pdo_` (0x{FRAME_INDEX:X})",
        "is in the messages alone. TPDO3 and TPDO4 have pages, which CANopen's mapping cannot express: it shows the page",
        "and its 40 bits. The 14 bits of an invalid displacement or shear are -8192. On CAN FD nothing is mapped.",
        "",
        *_table(("message", "objects, bits"), mapped),
        "Transmission types: 254, with each sample, as rate and divider allow; 1 to 240, with every n-th SYNC. All parts of a",
        "sample go together, by the type of TPDO1. There is no event timer: while the finger runs, samples do not end.",
        "",
    ]


def _several_hosts() -> list[str]:
    return [
        "### Several hosts, and requests made again",
        "",
        "CANopen gives an SDO channel to one client: answers name the object, segments not even that, and none names",
        "the client. A finger has one channel. On it",
        "",
        "- values of up to 4 bytes are read and written at any time, whatever other segments are under way;",
        "- one longer value is transferred at a time. Another one is refused with 0x08000022 until its last segment, or",
        "  until its client has been silent for 1 s: ask again;",
        "- a segment with the wrong toggle bit or direction ends the transfer, with 0x05030000;",
        "- a block transfer has the channel to itself: until its end, or until its client has been silent for 1 s, no other",
        "  request is answered, not even by an abort, which its client would take for its own. Uploads have the sub-blocks",
        "  that the client asks for, 1 to 127 segments, whatever pst is; downloads 31. The CRC is the client's choice. Segments go out",
        "  behind samples and take 0.3 of the bus. What gets lost is sent again, but for the last segment of a",
        "  sub-block of a download: nothing tells the finger that it was sent. Its client gives up and begins anew.",
        "",
        "Hosts that use `hostlink` may share a finger on a bus: each hears the others' requests, waits its turn, and asks",
        "again where it cannot tell whose an answer is. Any other client (a PLC, `canopen`, the C files) must be the only",
        "one that asks a finger; listening to samples takes no channel. A serial line has one host: its port is locked.",
        "",
        "A request may be sent again where no answer came; the finger does it once:",
        "",
        "- a segment that is equal to the last one gets the same answer;",
        "- so does a write of up to 3 bytes that carries a number of the client's in the bytes behind its value (CiA 301",
        "  leaves them open), for 2 s: another number each time, not 0. Without a number a write is taken as sent",
        "  again if it comes 0.25 to 1 s after the same one, with no other request between. What was refused is tried anew;",
        "- over a serial line: the same counter and content as the last request, for 2 s. A new connection begins with",
        "  a request whose answer it does not need.",
        "",
    ]


def _rest_frame() -> list[str]:
    return [
        "### Whether a tare succeeded",
        "",
        "A node counts a request for a rest frame, sets the state to BUSY and then answers the write to `tare` or",
        "`calibration`; the images are taken afterwards. So a host, once its write is answered,",
        "",
        "1. reads `rest_frame_request_n`: the number of its own request, or of a later one of another host;",
        "2. reads `rest_frame_state` until it is not BUSY;",
        "3. reads `rest_frame_reason` and `rest_frame_message`, which do not change any more, and",
        "   `rest_frame_request_n` once more: a higher number is a later request, and 2 begins anew; a lower one",
        "   says that the node has restarted.",
        "",
        "The rest frame and the calibration before stay in use, together, until new ones are accepted.",
        "",
        "After a rest frame that was refused or forced, `TARE_FAULT` is set until one is accepted. The values",
        "are then those of the rest frame in use; the bit forbids control all the same, for whoever asked for",
        "another one had a reason to. A request that is refused at once, with an abort code, sets no bit.",
        "",
        *_table(
            ("`rest_frame_state`", "name", "meaning"),
            [(state.value, state.name, text) for state, text in REST_FRAME_STATES.items()],
        ),
        *_table(
            ("`rest_frame_reason`", "name", "meaning"),
            [(reason.value, reason.name, text) for reason, text in REST_FRAME_REASONS.items()],
        ),
    ]


def _faults() -> list[str]:
    return [
        "## Status bits",
        "",
        f"`NO_CONTROL`, 0x{int(NO_CONTROL):04X}: the bits of samples that must never move a hand.",
        "",
        *_table(
            ("bit", "name", "meaning", "control on it?", "advice"),
            [
                (s.bit.value.bit_length() - 1, s.bit.name, s.meaning, "never" if s.no_control else "", s.advice)
                for s in STATUS
            ],
        ),
        "## Faults",
        "",
        "A fault sets its bit while it lasts, sends EMCY when it appears, and EMCY 0 when all are gone.",
        "",
        *_table(
            ("fault", "name", "status bit", "EMCY", "register", "meaning", "the host sees", "clears"),
            [
                (f.code.value, f.code.name, f.status.name, f"0x{f.emcy:04X}", f"0x{f.register:02X}", f.meaning,
                 f.host_sees, f.clears)
                for f in FAULTS
            ],
        ),
    ]  # fmt: skip


def markdown() -> str:
    """The whole document."""
    assert all(name in CLASSIC_BITS or field_named(name) for p in PARTS for name in p.fields)
    lines = [
        "# The wire",
        "",
        "Generated from `hostlink/wire` by `make generate`; do not edit.",
        "",
        f"Version {VERSION}, schema 0x{SCHEMA_HASH:08X}. Files for tools: `dbc/`, `eds/`, `c/`.",
        "",
        *_receiver(),
        *_state(),
        *_classic(),
        *_serial(),
        *_detail(),
        *_protection(),
        *_canopen(),
        *_faults(),
        "## Why?",
        "",
        *_table(("decision", "why"), _WHY),
    ]
    return "\n".join(lines).rstrip() + "\n"
