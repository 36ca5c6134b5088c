"""The electronic data sheet (CiA 306) of the object table; `canopen` and CANopen tools read it."""

from __future__ import annotations

from typing import Final

from hostlink.wire.fields import VERSION
from hostlink.wire.objects import GROUPS, OBJECTS, TYPES, Object, object_named

__all__ = ["eds"]

_MANDATORY: Final = (0x1000, 0x1001, 0x1018)  # CiA 301
_VAR, _DOMAIN = 0x7, 0x2
_RATES_KBIT: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
_RATES_SUPPORTED: Final = (125, 250, 500, 800, 1000)


def _default(obj: Object) -> str:
    if obj.default is None:
        return ""
    if isinstance(obj.default, int):
        return f"$NODEID+0x{obj.default:X}" if obj.node_id else f"0x{obj.default:X}"
    if isinstance(obj.default, bytes):
        return obj.default.hex()
    return str(obj.default)


def _variable(section: str, obj: Object) -> list[str]:
    lines = [
        f"[{section}]",
        f"ParameterName={obj.name}",
        f"ObjectType=0x{_DOMAIN if obj.type == 'domain' else _VAR:X}",
        f"DataType=0x{TYPES[obj.type][0]:04X}",
        f"AccessType={obj.access}",
        f"DefaultValue={_default(obj)}",
        "PDOMapping=0",
    ]
    if obj.low is not None and obj.high is not None and obj.type != "real32":
        lines += [f"LowLimit=0x{int(obj.low):X}", f"HighLimit=0x{int(obj.high):X}"]
    if obj.unit:
        lines.append(f"Unit={obj.unit}")
    lines += [f"Description={obj.meaning.replace(';', ',')}", ""]  # a semicolon begins a comment
    return lines


def _index(index: int) -> list[str]:
    rows = [o for o in OBJECTS if o.index == index]
    if index not in GROUPS:
        return _variable(f"{index:04X}", rows[0])
    name, kind = GROUPS[index]
    head = [f"[{index:04X}]", f"ParameterName={name}", f"ObjectType=0x{kind:X}", f"SubNumber={len(rows)}", ""]
    return head + [line for o in rows for line in _variable(f"{index:04X}sub{o.sub:X}", o)]


def _list(section: str, indexes: list[int]) -> list[str]:
    entries = [f"{i}=0x{index:04X}" for i, index in enumerate(indexes, 1)]
    return [f"[{section}]", f"SupportedObjects={len(indexes)}", *entries, ""]


def eds() -> str:
    """The file's text. Dates are fixed: the same tables give the same file."""
    indexes = sorted({o.index for o in OBJECTS})
    optional = [i for i in indexes if i < 0x2000 and i not in _MANDATORY]
    rates = [f"BaudRate_{rate}={int(rate in _RATES_SUPPORTED)}" for rate in _RATES_KBIT]
    lines = [
        "[FileInfo]",
        "FileName=voronoi_touch.eds",
        f"FileVersion={VERSION}",
        "FileRevision=0",
        "EDSVersion=4.0",
        "Description=voronoi-touch fingertip",
        "CreationTime=12:00AM",
        "CreationDate=01-01-2026",
        "CreatedBy=hostlink.wire.generate",
        "",
        "[DeviceInfo]",
        "VendorName=voronoi-touch",
        f"VendorNumber={_default(object_named('vendor_id'))}",
        f"ProductName={_default(object_named('device_name'))}",
        f"ProductNumber={_default(object_named('product_code'))}",
        f"RevisionNumber={_default(object_named('revision'))}",
        "OrderCode=",
        *rates,
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=0",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        "NrOfRXPDO=0",
        "NrOfTXPDO=4",
        "LSS_Supported=0",
        "",
        "[DummyUsage]",
        *(f"Dummy{i:04d}=0" for i in range(1, 8)),
        "",
        "[Comments]",
        "Lines=1",
        "Line1=Layout of the TPDOs: DBC files, WIRE.md",
        "",
        *_list("MandatoryObjects", list(_MANDATORY)),
        *_list("OptionalObjects", optional),
        *_list("ManufacturerObjects", [i for i in indexes if i >= 0x2000]),
    ]
    for index in indexes:
        lines += _index(index)
    return "\n".join(lines)
