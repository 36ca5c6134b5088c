"""Figures for print, by matplotlib (extra `plot`): the same two panels with axes, and the 3D surface.

matplotlib is loaded inside the functions: the edge draws without it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from edge.errors import InputError
from edge.types import Array, Features, Frame, Tracks
from edge.view.palette import PAPER, PARAMS, Bgr, cell_colours

_COLUMN_IN = 7.16  # both columns of an IEEE page
#: Left, bottom, width, height of the surface's box in the figure: it fills it, with space for the label of z.
_SURFACE_BOX = (-0.05, -0.02, 1.0, 1.1)


def _figure(width_in: float, height_in: float) -> Any:
    """A figure that needs no window system."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f"figures: {error}; install voronoi-touch[plot]") from error
    made = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(made)
    return made


def _rgb(colour: Bgr) -> tuple[float, float, float]:
    return colour[2] / 255, colour[1] / 255, colour[0] / 255


def _colours_of_change() -> dict[str, Any]:
    """How area changes are drawn, as matplotlib takes it."""
    from matplotlib.colors import ListedColormap, Normalize

    most = PARAMS.full_change
    colours = cell_colours(np.linspace(-1, 1, 257) * most, PAPER)[:, ::-1] / 255
    return {"cmap": ListedColormap(colours), "norm": Normalize(-most, most)}


def _origin(xy_img: Array, mm_per_px: float) -> tuple[Array, float, str]:
    """Origin of the axes, units of an image px, and the axes' unit."""
    if mm_per_px:
        return np.nanmean(xy_img, axis=0), mm_per_px, "mm"
    return np.zeros(2), 1.0, "px"


def figure(
    path: str | Path,
    frame: Frame,
    tracks: Tracks,
    polygons: Sequence[Array],
    features: Features,
    *,
    mm_per_px: float = 0.0,
) -> None:
    """The paper's figure: touch (left), camera image (right). PNG, PDF or SVG by the name.

    mm_per_px  0: axes in px of the image; else in mm from the tip's middle
    """
    rest = tracks.xy_img - features.displacement_px
    origin, unit_per_px, unit = _origin(rest, mm_per_px)

    def place(xy_img: Array) -> Array:
        placed: Array = (xy_img - origin) * unit_per_px
        return placed

    made = _figure(_COLUMN_IN, 3.6)
    left, right = made.subplots(1, 2)
    kept = [i for i, p in enumerate(polygons) if len(p) >= 3 and np.isfinite(p).all()]
    cells = _cells([place(polygons[i]) for i in kept], features.area_change[kept])
    left.add_collection(cells)
    xy = place(tracks.xy_img)
    left.plot(*xy.T, ".", color=_rgb(PAPER.pin), markersize=1.5)
    left.quiver(
        *xy.T, *(features.displacement_px * unit_per_px).T, angles="xy", scale_units="xy", scale=0.5,
        color=[_rgb(PAPER.local)], width=0.0025, headwidth=3,
    )  # fmt: skip
    if features.shear_px is not None:
        shear = features.shear_px * unit_per_px
        if PARAMS.global_gain * np.hypot(*features.shear_px) >= 1.0:  # a pixel long at least
            _draw_shear(left, place(np.nanmean(rest, axis=0)), shear)
    for contact in features.contacts or ():
        _draw_contact(left, place(contact.xy_img))
    _draw_camera(right, frame, place)
    right.plot(*xy.T, "o", mfc="none", mec="#ffc800", markersize=3, mew=0.5)
    outline = place(np.concatenate([polygons[i] for i in kept])) if kept else xy
    for axes, title in ((left, "cells, contacts, pin motion (x2, mean x6)"), (right, "camera, pins seen")):
        _label(axes, title, outline, unit)
    bar = made.colorbar(cells, ax=[left, right], location="bottom", shrink=0.5, aspect=40, pad=0.02)
    bar.set_label("relative change of cell area (+ grown, as where pressed in; - shrunk)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    made.savefig(path, dpi=200)


def _cells(polygons: Sequence[Array], change: Array) -> Any:
    from matplotlib.collections import PolyCollection

    return PolyCollection(
        polygons,
        array=change,
        **_colours_of_change(),
        edgecolors=[_rgb(PAPER.edge)],
        linewidths=0.4,
    )


def _draw_shear(axes: Any, middle: Array, shear: Array) -> None:
    """The mean motion as an arrow."""
    axes.quiver(
        *middle, *shear, angles="xy", scale_units="xy", scale=1 / PARAMS.global_gain,
        color=[_rgb(PAPER.shear)], zorder=4, edgecolor="white", linewidth=0.8,
    )  # fmt: skip


def _draw_contact(axes: Any, at: Array) -> None:
    for width, colour in ((3.0, PAPER.halo), (1.4, PAPER.contact)):
        axes.plot(*at, marker=(6, 2, 0), color=_rgb(colour), markersize=11, mew=width, zorder=5)


def _draw_camera(axes: Any, frame: Frame, place: Callable[[Array], Array]) -> None:
    height, width = frame.image.shape
    corners = place(np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]]))
    axes.imshow(
        frame.image,
        cmap="gray",
        vmax=(1 << frame.bits) - 1,
        extent=(corners[0, 0], corners[1, 0], corners[1, 1], corners[0, 1]),
    )


def _label(axes: Any, title: str, outline: Array, unit: str) -> None:
    """Title, names of the axes, and limits that contain the outline."""
    low, high = np.nanmin(outline, axis=0), np.nanmax(outline, axis=0)
    pad = 0.02 * float((high - low).max())
    axes.set(xlim=(low[0] - pad, high[0] + pad), ylim=(high[1] + pad, low[1] - pad), aspect="equal")
    axes.set_xlabel(f"x ({unit})", fontsize=8)
    axes.set_ylabel(f"y, down ({unit})", fontsize=8)
    axes.set_title(title, fontsize=8)
    axes.tick_params(labelsize=7)


def surface_figure(
    path: str | Path,
    features: Features,
    *,
    mm_per_px: float = 0.0,
) -> None:
    """The smooth surface of area change over the tip, in 3D; contacts as stars on its maxima.

    features.surface  must have been demanded
    Raises            InputError: it was not
    """
    if features.surface is None or features.grid_img is None:
        raise InputError("figures: no surface in these features; demand Feature.SURFACE and touch the tip")
    from matplotlib.cm import ScalarMappable

    grid_x, grid_y = features.grid_img
    inside = np.isfinite(features.surface)
    origin, unit_per_px, unit = _origin(np.array([[grid_x.mean(), grid_y.mean()]]), mm_per_px)
    x, y = np.meshgrid((grid_x - origin[0]) * unit_per_px, (grid_y - origin[1]) * unit_per_px)
    height = np.where(inside, features.surface, np.nan)
    made = _figure(4.2, 3.1)
    made.set_layout_engine("none")  # it would not account for the labels of a rotated box
    axes = made.add_axes(_SURFACE_BOX, projection="3d", computed_zorder=False)
    scale = ScalarMappable(**_colours_of_change())
    axes.plot_surface(
        x, y, height, facecolors=scale.to_rgba(height), rstride=1, cstride=1,
        linewidth=0.15, edgecolor=(0.35, 0.35, 0.35, 0.5), antialiased=True, shade=False,
    )  # fmt: skip
    for contact in features.contacts or ():
        at = (contact.xy_img - origin) * unit_per_px
        # It lies on the surface as drawn: `contact.peak` is the maximum between the grid's points.
        near = np.hypot(x - at[0], y - at[1])
        top = float(height.flat[np.argmin(np.where(inside, near, np.inf))])
        axes.plot(
            [at[0]], [at[1]], [top + 0.02], marker=(6, 2, 0), color=_rgb(PAPER.contact),
            markersize=12, mew=1.8, zorder=10,
        )  # fmt: skip
    axes.set_xlabel(f"x ({unit})", fontsize=8, labelpad=-4)
    axes.set_ylabel(f"y, down ({unit})", fontsize=8, labelpad=-4)
    axes.set_zlabel("relative area change", fontsize=8, labelpad=-6)
    axes.tick_params(labelsize=7, pad=-2)
    axes.locator_params(nbins=5)
    axes.invert_yaxis()
    axes.view_init(elev=32, azim=-60)
    axes.set_box_aspect((1, 1, 0.45), zoom=1.0)
    made.savefig(path, dpi=200)
