"""Rates and features as parameters of the node: what `ros2 param` and rqt ask for (rcl_interfaces)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from hostlink.bridge.ros_node import NODE, RosNode
from hostlink.bridge.ros_types import Types
from hostlink.bridge.values import ParameterDesk
from hostlink.wire import Object, object_named
from hostlink.wire.objects import FEATURE_BITS

__all__ = ["RosParameters"]


class _ParameterKind(NamedTuple):
    """A row of ParameterType: its number; the member of ParameterValue; the member and type of its limits."""

    number: int
    value: str
    limits: str
    range: str
    convert: Callable[[float], float]


_INTEGER: Final = _ParameterKind(2, "integer_value", "integer_range", "IntegerRange", int)
_DOUBLE: Final = _ParameterKind(3, "double_value", "floating_point_range", "FloatingPointRange", float)
#: A value may be set as any of these: whole numbers are numbers.
_SETTABLE: Final = {kind.number: kind.value for kind in (_INTEGER, _DOUBLE)}


class RosParameters:
    """Serves them. The services run in threads of Zenoh's, one each; each access asks a finger."""

    def __init__(self, node: RosNode, types: Types, desk: ParameterDesk) -> None:
        self._types, self._desk = types, desk
        for name, answer in (
            ("ListParameters", self._list),
            ("GetParameters", self._get),
            ("GetParameterTypes", self._kinds),
            ("DescribeParameters", self._describe),
            ("SetParameters", self._set),
            ("SetParametersAtomically", self._set_all),
        ):
            kind = f"rcl_interfaces/srv/{name}"
            snake = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).strip("_")

            def take(data: bytes, kind: str = kind, answer: Any = answer) -> bytes:
                values = answer(types.unpack_request(kind, data))
                return types.pack_response(kind, **values)

            node.serve(kind, f"{node.namespace}/{NODE}/{snake}", take)

    def _make(self, kind: str, **values: Any) -> Any:
        return self._types.make(f"rcl_interfaces/msg/{kind}", **values)

    def _list(self, request: Any) -> dict[str, Any]:
        names = self._desk.names()
        if request.prefixes:
            heads = tuple(f"{prefix}." for prefix in request.prefixes)
            names = [name for name in names if name.startswith(heads) or name in request.prefixes]
        prefixes = [*dict.fromkeys(name.partition(".")[0] for name in names)]
        return {"result": self._make("ListParametersResult", names=names, prefixes=prefixes)}

    def _get(self, request: Any) -> dict[str, Any]:
        """A parameter that cannot be read is not set, as ROS calls it."""
        known = self._desk.read(request.names)
        return {"values": [self._value(name, known.get(name)) for name in request.names]}

    def _value(self, name: str, value: Any) -> Any:
        if value is None:
            return self._make("ParameterValue")
        kind = _kind_of(object_named(_key(name)))
        return self._make("ParameterValue", type=kind.number, **{kind.value: value})

    def _kinds(self, request: Any) -> dict[str, Any]:
        import numpy as np

        known = set(self._desk.names())
        kinds = [_kind_of(object_named(_key(name))).number if name in known else 0 for name in request.names]
        return {"types": np.array(kinds, np.uint8)}

    def _describe(self, request: Any) -> dict[str, Any]:
        known = set(self._desk.names())
        return {"descriptors": [self._descriptor(name) for name in request.names if name in known]}

    def _descriptor(self, name: str) -> Any:
        obj = object_named(_key(name))
        kind = _kind_of(obj)
        limits = {"from_value": kind.convert(obj.low or 0), "to_value": kind.convert(obj.high or 0)}
        bits = ", ".join(f"{bit}: {feature}" for feature, bit in FEATURE_BITS.items())
        meaning = f"{obj.meaning} [{obj.unit}]" if obj.unit else obj.meaning
        return self._make(
            "ParameterDescriptor",
            name=name,
            type=kind.number,
            description=f"{meaning}: {bits}" if obj.name == "features" else meaning,
            **{kind.limits: [self._make(kind.range, **limits)]},
        )

    def _set(self, request: Any) -> dict[str, Any]:
        return {"results": [self._result(self._write(parameter)) for parameter in request.parameters]}

    def _set_all(self, request: Any) -> dict[str, Any]:
        """Set them in order, up to the first that is refused: a finger has no transactions."""
        refused = next(filter(None, map(self._write, request.parameters)), "")
        return {"result": self._result(refused)}

    def _result(self, refused: str) -> Any:
        return self._make("SetParametersResult", successful=not refused, reason=refused)

    def _write(self, parameter: Any) -> str:
        field = _SETTABLE.get(parameter.value.type)
        value = getattr(parameter.value, field) if field else None
        return self._desk.write(parameter.name, value)


def _key(name: str) -> str:
    return name.partition(".")[2]


def _kind_of(obj: Object) -> _ParameterKind:
    return _DOUBLE if obj.type == "real32" else _INTEGER
