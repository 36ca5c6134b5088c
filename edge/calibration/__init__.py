"""From geometry to mechanical units: a tip's calibration, and its application to one frame.

file     the JSON file: structure, checks, load, save
inputs   what models depend on, from a frame's features or one contact
grip     friction and slip margin, from the forces that a touch has held
model    curves, polynomials and processes ready to run; `Calibration.apply`: features in, a reading out
"""

from edge.calibration.file import CalibrationFile
from edge.calibration.grip import OF_GRIP, Grip
from edge.calibration.model import Calibration, uncalibrated

__all__ = ["OF_GRIP", "Calibration", "CalibrationFile", "Grip", "uncalibrated"]
