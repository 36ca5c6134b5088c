"""Pictures as in the paper: cells shaded by area change, contacts, shear, beside the camera's image.

    view = View.of(rest_xy_img, pitch_px)          what part of the image, how large; once a tip
    canvas = picture(view, frame, tracks, cells_img, features)      OpenCV: live view, video
    figure(...), surface_figure(...)               matplotlib: print; extra `calib`
    render(pictures, "out.mp4", rate_hz)           video

Everything takes the types that flow between the stages; polygons come from the tessellation.
"""

from __future__ import annotations

from edge.draw.palette import PAPER, SAFE, Palette, cell_colours, cell_rgba
from edge.draw.panels import View, draw_camera, draw_touch, picture, save_pins_overlay
from edge.draw.plots import figure, surface_figure
from edge.draw.video import render

__all__ = [
    "PAPER",
    "SAFE",
    "Palette",
    "View",
    "cell_colours",
    "cell_rgba",
    "draw_camera",
    "draw_touch",
    "figure",
    "picture",
    "render",
    "save_pins_overlay",
    "surface_figure",
]
