"""`python -m calib simulate`: a calibration of a known sensor's simulated tip, in one command."""

from pathlib import Path

import click

from calib.commands.fit import print_choices
from calib.commands.options import PATH, overwrite_option, progress_bar
from calib.errors import TableError
from calib.sim import Simulator
from calib.sim.mechanics import Tool
from calib.sim.of_sensor import appearance_of, camera_of, depth_factor
from calib.sim.render import Appearance
from calib.simulated_calibration import WHOLE, Range, calibrate_simulated
from edge.sensors import load_sensor
from hostlink.cli_types import WholeNumber
from hostlink.output_file import check_output, writing


@click.command("simulate")
@click.argument("sensor_name", metavar="NAME|FILE.toml")
@click.option("-o", "--output", required=True, type=PATH, help="Calibration file to write (.json).")
@overwrite_option
@click.option(
    "--tool",
    type=click.Choice(["sphere", "flat"]),
    default="sphere",
    show_default=True,
    help="What presses: a ball of 3 mm radius, or a flat surface, which is tilted too.",
)
@click.option("--presses", type=WholeNumber(50, 2000), default=150, show_default=True, help="Random poses.")
@click.option(
    "--seed", type=WholeNumber(0, 2**31 - 1), default=0, show_default=True, help="Decides the poses."
)
@click.option("-q", "--quiet", is_flag=True, help="No progress bar.")
def simulate_command(
    sensor_name: str, output: Path, overwrite: bool, tool: str, presses: int, seed: int, quiet: bool
) -> None:
    """Press a known sensor's simulated tip at random, and fit a calibration to what its camera sees.

    It belongs to `sim:...?sensor=NAME`, for trying out all that comes after a calibration; a real tip needs
    one of its own.
    """
    check_output(output, (".json",), (), overwrite)
    sensor = load_sensor(sensor_name)
    try:
        simulator = Simulator(camera_of(sensor), appearance_of(sensor, Appearance()), seed)
    except ValueError as error:
        raise TableError(str(error)) from None
    factor = depth_factor(sensor)
    low, high = WHOLE.depth_mm
    reach = Range(
        (low * factor, high * factor),
        WHOLE.shear_mm * factor,
        WHOLE.tilt_deg * factor,
        WHOLE.twist_deg * factor,
    )
    with progress_bar(quiet) as bar:
        task = bar.add_task("presses", total=presses)
        calibration, choices = calibrate_simulated(
            simulator,
            Tool(kind=tool, radius_mm=3.0),
            n_frames=presses,
            seed=seed,
            reach=reach,
            serial=f"simulated {sensor.name}"[:64],
            on_done=lambda n: bar.advance(task, n),
        )
    with writing(output, overwrite) as unfinished:
        unfinished.write_bytes(calibration.encoded)
    print_choices(choices, str(output))
