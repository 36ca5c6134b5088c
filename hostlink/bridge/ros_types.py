"""Messages and services of ROS 2's distributions: made, packed as CDR, and hashed as keys have them.

rosbags knows messages, no services. A service's hash is that of a type with a request, a response and an
event (REP 2016), of which rosbags can make it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from hostlink.extras import require

__all__ = ["DISTRIBUTIONS", "EXTRA", "SERVICES", "TRIGGER", "Types", "endpoint_name", "message_of"]

EXTRA: Final = "ros"
MESSAGES: Final = Path(__file__).parent / "voronoi_touch_msgs" / "msg"
DISTRIBUTIONS: Final = ("humble", "jazzy", "kilted", "lyrical")
TRIGGER: Final = "std_srvs/srv/Trigger"
_NO_HASH: Final = "TypeHashNotSupported"  # Humble's

#: Services of rcl_interfaces, by the name under a node: its type; request; response.
_PARAMETERS: Final = (
    ("ListParameters", "string[] prefixes\nuint64 depth", "rcl_interfaces/ListParametersResult result"),
    ("GetParameters", "string[] names", "rcl_interfaces/ParameterValue[] values"),
    ("GetParameterTypes", "string[] names", "uint8[] types"),
    ("DescribeParameters", "string[] names", "rcl_interfaces/ParameterDescriptor[] descriptors"),
    ("SetParameters", "rcl_interfaces/Parameter[] parameters",
     "rcl_interfaces/SetParametersResult[] results"),
    ("SetParametersAtomically", "rcl_interfaces/Parameter[] parameters",
     "rcl_interfaces/SetParametersResult result"),
)  # fmt: skip
#: Service -> its request and its response, as `.srv` files have them.
SERVICES: Final = {
    TRIGGER: ("uint8 structure_needs_at_least_one_member", "bool success\nstring message"),
    **{f"rcl_interfaces/srv/{name}": (request, response) for name, request, response in _PARAMETERS},
}
_ZEROS: Final = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
_PARTS: Final = ("Request", "Response", "Event")


class Types:
    """Messages of a distribution, and their names and hashes on the wire.

    Raises UsageError: extra not installed
    """

    def __init__(self, distribution: str) -> None:
        self._library = require("rosbags.typesys", EXTRA)
        self._kinds = require("rosbags.interfaces", EXTRA).Nodetype
        store = getattr(self._library.Stores, f"ROS2_{distribution.upper()}")
        self.store = self._library.get_typestore(store)
        for path in sorted(MESSAGES.glob("*.msg")):
            self._register(f"voronoi_touch_msgs/msg/{path.stem}", path.read_text(encoding="utf-8"))
        for name, texts in SERVICES.items():
            for part, text in zip(_PARTS, texts, strict=False):
                self._register(message_of(name, part), text)
        self._empty: dict[str, dict[str, Any]] = {}
        self._hashed = distribution != "humble"
        if self._hashed:
            self._describe_services()

    def _register(self, name: str, text: str) -> None:
        self.store.register(self._library.get_types_from_msg(text, name))

    def _describe_services(self) -> None:
        """The description, as far as hashes need it."""
        kinds, fields = self._kinds, self.store.fielddefs
        info = "service_msgs/msg/ServiceEventInfo"

        def nested(name: str) -> Any:
            return (kinds.NAME, name)

        gid = (kinds.ARRAY, ((kinds.BASE, ("uint8", 0)), 16))  # `char` there, which is uint8
        consts, members = fields[info]
        fields[info] = (consts, [(n, gid if n == "client_gid" else kind) for n, kind in members])
        for name in SERVICES:
            both = [(n.lower(), (kinds.SEQUENCE, (nested(f"{name}_{n}"), 1))) for n in _PARTS[:2]]
            for part in _PARTS[:2]:
                fields[f"{name}_{part}"] = fields[message_of(name, part)]
            fields[f"{name}_Event"] = ([], [("info", nested(info)), *both])
            fields[name] = ([], [(f"{part.lower()}_message", nested(f"{name}_{part}")) for part in _PARTS])

    def make(self, kind: str, /, **values: Any) -> Any:
        """A message; a member that is not given is zero, empty or false, as ROS has it."""
        if kind not in self._empty:  # what messages share is never changed
            self._empty[kind] = {name: self._zero(*of) for name, of in self.store.fielddefs[kind][1]}
        return self.store.types[kind](**(self._empty[kind] | values))

    def _zero(self, kind: Any, of: Any) -> Any:
        kinds = self._kinds
        if kind == kinds.NAME:
            return self.make(of)
        if kind == kinds.BASE:
            return _ZEROS.get(of[0], 0)
        n = of[1] if kind == kinds.ARRAY else 0
        (inner_kind, inner), numpy = of[0], require("numpy", EXTRA)
        if inner_kind == kinds.BASE and inner[0] != "string":
            return numpy.zeros(n, {"char": "uint8", "octet": "uint8"}.get(inner[0], inner[0]))
        return [self._zero(inner_kind, inner) for _ in range(n)]

    def pack(self, message: Any) -> bytes:
        """Its CDR, with the header that says so."""
        return bytes(self.store.serialize_cdr(message, message.__msgtype__))

    def unpack_request(self, service: str, data: bytes) -> Any:
        """A service's request. Raises what rosbags raises: it is none."""
        return self.store.deserialize_cdr(data, message_of(service, "Request"))

    def pack_response(self, service: str, **values: Any) -> bytes:
        """A service's response."""
        return self.pack(self.make(message_of(service, "Response"), **values))

    def hash_of(self, name: str) -> str:
        """The hash as it stands in keys."""
        return str(self.store.hash_rihs01(name)) if self._hashed else _NO_HASH


def message_of(service: str, part: str) -> str:
    """The message that stands for a service's "Request" or "Response"."""
    return f"{service.replace('/srv/', '/msg/')}_{part}"


def endpoint_name(name: str) -> str:
    """A type as it stands in keys: `std_msgs/msg/String` is `std_msgs::msg::dds_::String_`."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"
