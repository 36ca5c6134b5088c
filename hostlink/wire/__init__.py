"""The definition of the wire format. Standard library only; imports only itself.

fields    THE table: state frame and classic parts; schema hash, version
state     State, Contact; pack_state / unpack_state (64 bytes, CAN FD and serial)
parts     pack_parts / unpack_part / Assembler (8 bytes, classic CAN)
detail    pack_detail / unpack_segment / DetailAssembler (every pin, CAN FD and serial)
status    status bits, fault table
objects   the object table: SDO and serial requests
canid     CAN identifiers, bases configurable
nmt       a node's states, and the commands that lead to them
address   address of an end of the wire; open_errors: advice if it cannot be opened
serial    message types, object requests and replies, framing; on cobs
e2e       AUTOSAR E2E profiles 5 and 11C
generate  `python -m hostlink.wire.generate`: DBC, EDS, C, documentation from the tables
"""

from hostlink.wire.canid import CanIds, Kind
from hostlink.wire.detail import Detail, DetailAssembler, pack_detail, unpack_segment
from hostlink.wire.errors import CorruptFrame, LinkError, ObjectAborted, VersionMismatch, WireError
from hostlink.wire.fields import DATA_ID, FIELDS, SCHEMA_HASH, STATE_SIZE, VERSION, Field
from hostlink.wire.objects import (
    ABORTS,
    FEATURE_BITS,
    OBJECTS,
    Abort,
    Object,
    RestFrameReason,
    RestFrameState,
    object_at,
    object_named,
    pack_value,
    unpack_value,
)
from hostlink.wire.parts import Assembler, pack_parts, unpack_part
from hostlink.wire.serial import (
    Message,
    ObjectReply,
    ObjectRequest,
    Op,
    encode_frame,
    pack_emergency,
    pack_message,
    unpack_emergency,
    unpack_message,
)
from hostlink.wire.state import Contact, State, pack_state, unpack_state
from hostlink.wire.status import FAULTS, NO_CONTROL, STATUS, Fault, FaultCode, Status

__all__ = [
    "ABORTS",
    "DATA_ID",
    "FAULTS",
    "FEATURE_BITS",
    "FIELDS",
    "NO_CONTROL",
    "OBJECTS",
    "SCHEMA_HASH",
    "STATE_SIZE",
    "STATUS",
    "VERSION",
    "Abort",
    "Assembler",
    "CanIds",
    "Contact",
    "CorruptFrame",
    "Detail",
    "DetailAssembler",
    "Fault",
    "FaultCode",
    "Field",
    "Kind",
    "LinkError",
    "Message",
    "Object",
    "ObjectAborted",
    "ObjectReply",
    "ObjectRequest",
    "Op",
    "RestFrameReason",
    "RestFrameState",
    "State",
    "Status",
    "VersionMismatch",
    "WireError",
    "encode_frame",
    "object_at",
    "object_named",
    "pack_detail",
    "pack_emergency",
    "pack_message",
    "pack_parts",
    "pack_state",
    "pack_value",
    "unpack_emergency",
    "unpack_message",
    "unpack_part",
    "unpack_segment",
    "unpack_state",
    "unpack_value",
]
