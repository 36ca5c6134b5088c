"""From geometry to mechanical units: a tip's calibration, and its application to one frame.

file     the JSON file: structure, checks, load, save
inputs   what models depend on, by name
grip     friction and slip margin, from the forces that a touch has held
model    the models ready to run, and their inputs; `Calibration.apply`: features in, a reading out
"""

from edge.calibration.file import CalibrationFile
from edge.calibration.grip import OF_GRIP, Grip
from edge.calibration.model import Calibration, uncalibrated

__all__ = ["OF_GRIP", "Calibration", "CalibrationFile", "Grip", "uncalibrated"]
