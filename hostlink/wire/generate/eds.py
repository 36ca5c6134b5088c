"""The electronic data sheet (CiA 306) of the object table, written by `canopen`; CANopen tools read it."""

from __future__ import annotations

from io import StringIO
from typing import Any, Final

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable
from canopen.objectdictionary.eds import export_eds

from hostlink.wire.fields import VERSION
from hostlink.wire.objects import FRAME_INDEX, GROUPS, OBJECTS, SAMPLE_INDEX, TYPES, Object, object_named

__all__ = ["eds"]

_ARRAY: Final = 8  # CiA 301's object code
_BITRATES: Final = (125_000, 250_000, 500_000, 800_000, 1_000_000)
# A date of writing would make another file of the same tables.
_FILE_INFO: Final = {
    "FileName": "voronoi_touch.eds",
    "FileVersion": VERSION,
    "FileRevision": 0,
    "EdsVersion": "4.0",
    "Description": "voronoi-touch fingertip",
    "CreationTime": "12:00AM",
    "CreationDate": "01-01-2026",
    "ModificationTime": "12:00AM",
    "ModificationDate": "01-01-2026",
    "CreatedBy": "hostlink.wire.generate",
}


def _variable(obj: Object) -> Any:
    variable: Any = ODVariable(obj.name, obj.index, obj.sub)  # whose annotations allow integers alone
    variable.data_type = TYPES[obj.type][0]
    variable.access_type = obj.access
    variable.pdo_mappable = obj.index in (SAMPLE_INDEX, FRAME_INDEX) and obj.sub > 0
    variable.factor = obj.scale
    variable.default = "" if obj.default is None and obj.type == "visible_string" else obj.default
    if obj.node_id and isinstance(obj.default, int):
        variable.default_raw = f"$NODEID+0x{obj.default:X}"
    if obj.type != "real32":  # limits of real numbers have no form in an EDS
        variable.min, variable.max = obj.low, obj.high
    variable.unit = obj.unit
    variable.description = obj.meaning.replace(";", ",")  # a semicolon begins a comment
    return variable


def _dictionary() -> ObjectDictionary:
    dictionary = ObjectDictionary()
    for index in sorted({o.index for o in OBJECTS}):
        rows = [o for o in OBJECTS if o.index == index]
        if index not in GROUPS:
            dictionary.add_object(_variable(rows[0]))
            continue
        name, kind = GROUPS[index]
        group = (ODArray if kind == _ARRAY else ODRecord)(name, index)
        for row in rows:
            group.add_member(_variable(row))
        dictionary.add_object(group)
    return dictionary


def eds() -> str:
    """The file's text."""
    dictionary = _dictionary()
    dictionary.comments = "TPDOs of classic CAN; pages of TPDO3 and TPDO4: DBC files, WIRE.md"
    device: Any = dictionary.device_information
    device.allowed_baudrates = set(_BITRATES)
    device.vendor_name = "voronoi-touch"
    device.vendor_number = object_named("vendor_id").default
    device.product_name = object_named("device_name").default
    device.product_number = object_named("product_code").default
    device.revision_number = object_named("revision").default
    device.simple_boot_up_master, device.simple_boot_up_slave = False, True
    device.order_code, device.granularity = "", 1
    device.dynamic_channels_supported = device.group_messaging = device.LSS_supported = False
    device.nr_of_RXPDO, device.nr_of_TXPDO = 0, 4
    file = StringIO()
    export_eds(dictionary, file, dict(_FILE_INFO))
    return file.getvalue().rstrip("\n") + "\n"
