"""How viewers show the values of a sample, from the rows of the table: live pages and `plot`."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from hostlink.wire.fields import Field, Shown

__all__ = ["WRENCH", "Chart", "charts_of", "live_charts", "live_fields", "page_numbers"]

#: Units as a reader has them; others are as on the wire.
_UNITS = {"mm2": "mm²", "deg": "°", "Nmm": "N mm"}


#: A wrench on the tip, z out of the skin: its parts in ROS's order, the field that each is, and by how much;
#: None: it is not measured.
WRENCH: Final = (
    ("force", "x", "force_x_n", 1.0),
    ("force", "y", "force_y_n", 1.0),
    ("force", "z", "force_n", -1.0),
    ("torque", "x", None, 0.0),
    ("torque", "y", None, 0.0),
    ("torque", "z", "torque_z_nmm", 1e-3),
)


@dataclass(frozen=True, slots=True)
class Chart:
    """The fields that are drawn together, and how; `unit` is a reader's, `names` tell the fields apart."""

    fields: tuple[str, ...]
    unit: str
    how: Shown
    names: tuple[str, ...] = ()


def charts_of(fields: Iterable[Field]) -> tuple[Chart, ...]:
    """Every chart, in the order of the table."""
    rows = [(f, f.shown) for f in fields if f.shown is not None]
    titles = dict.fromkeys(how.title for _, how in rows)
    groups = [[(f, how) for f, how in rows if how.title == title] for title in titles]
    return tuple(
        Chart(
            tuple(f.name for f, _ in group),
            _UNITS.get(group[0][0].unit, group[0][0].unit),
            group[0][1],
            tuple(how.number.split()[-1].lower() for _, how in group) if len(group) > 1 else (),
        )
        for group in groups
    )


def live_charts(fields: Iterable[Field]) -> list[dict[str, Any]]:
    """The charts of a live page, as its script takes them."""
    return [
        {
            "title": chart.how.title.capitalize(),
            "unit": chart.unit or "%",  # a share; labels are in percent
            "least": chart.how.least,
            "names": chart.names,
            "of": chart.fields,
        }
        for chart in charts_of(fields)
        if chart.how.least
    ]


def live_fields(fields: Iterable[Field]) -> tuple[str, ...]:
    """Names of the values in the live charts, in their order."""
    return tuple(name for chart in charts_of(fields) if chart.how.least for name in chart.fields)


def page_numbers(fields: Iterable[Field]) -> list[dict[str, Any]]:
    """The numbers beside a page's picture, as its script takes them: value times `factor`, in `unit`."""
    return [
        {
            "name": f.shown.number,
            "unit": "%" if (share := not f.unit and f.high == 1) else _UNITS.get(f.unit, f.unit),
            "of": f.name,
            "sigma": f.shown.sigma,
            "factor": 100 if share else 1,
            "digits": 0 if share else f.shown.digits,
        }
        for f in fields
        if f.shown is not None and f.shown.number
    ]
