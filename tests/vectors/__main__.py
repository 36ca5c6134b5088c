"""Writes the golden frames; to be run when, and only when, the wire's version changes."""

import json
from dataclasses import asdict
from math import inf, nan
from pathlib import Path
from typing import Any

from hostlink import wire
from hostlink.wire import Contact, State, Status

FILE = Path(__file__).with_name("frames.json")

FULL = State(
    sample=0x1234, status=Status.TOUCHED | Status.SATURATED, capture_time_us=0x89ABCDEF, latency_us=1870,
    pins_tracked=0.996, contact_n=5, displacement_mm=1.234, displacement_sigma_mm=0.032, force_n=2.5,
    force_x_n=-0.75, force_y_n=1.25, force_xy_sigma_n=0.12, torque_z_nmm=-14.5, torque_z_sigma_nmm=1.5,
    friction=0.84, slip_margin=0.304, pressure_kpa=31.25, contact_area_mm2=80.02, shear_x_mm=-0.5,
    shear_y_mm=0.75, shear_sigma_mm=0.104, torsion_deg=-3.21, tilt_x_deg=12.5, tilt_y_deg=-7.25,
    slip_speed_mm_s=4.5, slip_probability=0.252, twist_slip_probability=0.128, orientation_deg=-45.0,
    vibration_mm=0.034, temperature_degc=41.0, contacts=(Contact(1.5, -2.5, 1.2), Contact(0.0, 0.0)),
)  # fmt: skip
LIMITS = State(
    sample=0xFFFF, status=Status(0xFFFF), capture_time_us=0xFFFF_FFFF, latency_us=inf, pins_tracked=2.0,
    contact_n=99, displacement_mm=-inf, force_n=1e9, force_x_n=-1e9, force_xy_sigma_n=9.0, torque_z_nmm=1e9,
    friction=99.0, slip_margin=-1.0, temperature_degc=-300.0, contacts=(Contact(99.0, -99.0, 99.0),),
)  # fmt: skip
CASES = (("empty", State(), 0), ("full", FULL, 7), ("limits", LIMITS, 255))
PINS = [(0.02 * i, -0.04 * i, 0.01 * i) if i % 5 else (nan, nan, nan) for i in range(14)]


def plain(value: Any) -> Any:
    """JSON's view of a value: NaN and infinities as text."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float) and (value != value or value in (inf, -inf)):
        return str(value)
    return int(value) if isinstance(value, int) else value


def vectors() -> dict[str, Any]:
    """The contents of the file."""
    return {
        "version": wire.VERSION,
        "schema": f"0x{wire.SCHEMA_HASH:08X}",
        "samples": [
            {
                "name": name,
                "counter": counter,
                "state": plain(asdict(state)),
                "frame": wire.pack_state(state, counter).hex(),
                "parts": [[tpdo, part.hex()] for tpdo, part in wire.pack_parts(state, counter)],
                "serial": wire.encode_frame(wire.Message.STATE, wire.pack_state(state, counter)).hex(),
            }
            for name, state, counter in CASES
        ],
        "detail": {
            "sample": 77,
            "counter": 250,
            "rows": plain(PINS),
            "segments": [segment.hex() for segment in wire.pack_detail(77, PINS, 250)],
        },
    }


if __name__ == "__main__":
    FILE.write_text(json.dumps(vectors(), indent=1) + "\n", encoding="utf-8")
