"""Files for other people's tools, written from the tables of `hostlink.wire`.

    python -m hostlink.wire.generate [--check] [--out FOLDER]

    dbc   DBC of the FD and of the classic frames of finger 1, written by cantools
    eds   CANopen electronic data sheet, written by canopen
    c     C99 codec, written by cantools, and E2E
    doc   WIRE.md
    ros   ROS 2 messages
    python  attributes of `State`

Needs cantools (extra `dbc`) and canopen (`dev`). Of the rest only the command `dbc` imports some of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

__all__ = ["ROOT", "generate"]

ROOT: Final = Path(__file__).resolve().parents[2]  # of the package `hostlink`


def generate() -> dict[str, str]:
    """Every generated file: path relative to `hostlink` -> text.

    Raises ImportError: cantools or canopen is not installed
    """
    from hostlink.wire.generate import c, dbc, doc, eds, python, ros

    shown, coded = [dbc.Sender(1, "finger_1", 250.0)], [dbc.Sender(1, by_bit=False)]
    return {
        "dbc/voronoi_touch_fd.dbc": dbc.text(dbc.fd(shown)),
        "dbc/voronoi_touch_classic.dbc": dbc.text(dbc.classic(shown)),
        "eds/voronoi_touch.eds": eds.eds(),
        **{f"c/{name}": text for name, text in c.codec("vt_fd", dbc.fd(coded)).items()},
        **{f"c/{name}": text for name, text in c.codec("vt_classic", dbc.classic(coded)).items()},
        "c/vt_e2e.h": c.e2e_header(),
        "c/vt_e2e.c": c.e2e_source(),
        "c/vt_parts_fields.h": c.parts_fields(),
        "wire/generated_state.py": python.generated_state(),
        "WIRE.md": doc.markdown(),
        "bridge/voronoi_touch_msgs/msg/TactileContact.msg": ros.contact(),
        "bridge/voronoi_touch_msgs/msg/TactileSample.msg": ros.sample(),
    }
