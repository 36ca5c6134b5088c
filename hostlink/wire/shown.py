"""How viewers show the values of a sample, from the rows of the table: live pages and `plot`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from hostlink.wire.fields import Field

__all__ = ["WRENCH", "Chart", "Shown", "charts_of", "live_charts", "live_fields", "page_numbers"]

#: Units as a reader has them; others are as on the wire.
_UNITS = {"mm2": "mm²", "deg": "°", "Nmm": "N mm"}


@dataclass(frozen=True, slots=True)
class Shown:
    """How viewers show a value: pages beside the picture and over time, `plot` over time.

    title   of its chart; values with the same title share one, as x and y
    number  its name beside the picture; "": it is not shown there
    digits  behind the point there; a share is in percent
    sigma   the field with its standard deviation
    least   span of a live chart's axis at least, in the field's unit; 0: pages do not chart it
    always  the live chart is there before the first value
    """

    title: str
    number: str = ""
    digits: int = 2
    sigma: str = ""
    least: float = 0.0
    always: bool = False


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
    """The fields that are drawn together, and how; `unit` is a reader's."""

    fields: tuple[str, ...]
    unit: str
    how: Shown


def charts_of(fields: Iterable[Field]) -> tuple[Chart, ...]:
    """Every chart, in the order of the table."""
    rows = [(f, f.shown) for f in fields if f.shown is not None]
    titles = dict.fromkeys(how.title for _, how in rows)
    groups = [[(f, how) for f, how in rows if how.title == title] for title in titles]
    return tuple(
        Chart(tuple(f.name for f, _ in group), _UNITS.get(group[0][0].unit, group[0][0].unit), group[0][1])
        for group in groups
    )


def live_charts(fields: Iterable[Field]) -> list[dict[str, Any]]:
    """The charts of a live page, as its script takes them."""
    return [
        {
            "title": chart.how.title.capitalize(),
            "unit": chart.unit,
            "least": chart.how.least,
            "names": list("xy") if len(chart.fields) == 2 else [],
            "of": chart.fields,
            "optional": not chart.how.always,
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
