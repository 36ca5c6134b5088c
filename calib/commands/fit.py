"""`python -m calib fit`: a table of frames with truth in, a calibration out."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.table import Table

from calib.axes import Axes
from calib.carry_over import KnownModel, known_models
from calib.commands.evaluate import print_report
from calib.commands.options import PATH, Frames, frames_options, overwrite_option, progress_bar
from calib.dataset import Dataset
from calib.extract import Extract, executor
from calib.fit import Choice, Prefer, Search, fit, groups_of, of_views
from calib.fit_warnings import fit_warnings
from calib.hold_out import evaluate_held_out
from calib.skin import extract_of_dots
from calib.targets import Targets
from edge.calibration import Calibration, CalibrationFile
from edge.calibration.checks import is_of_contact, outputs_of
from edge.cli.options import sensor_option
from edge.errors import CalibrationError, ConfigError
from edge.rest.sensor_match import mm_per_px as scale_by_pitch
from edge.sensors import load_sensor
from edge.types import Rest
from hostlink.cli_types import FiniteFloat, WholeNumber, counted
from hostlink.output_file import check_output, writing


@click.command("fit")
@frames_options
@click.option("-o", "--output", required=True, type=PATH, help="Calibration file to write (.json).")
@overwrite_option
@click.option("--serial", default="unnamed", show_default=True, help="Serial number of the tip.")
@click.option(
    "--mm-per-px",
    type=FiniteFloat(min=1e-4, max=10.0),
    help="Scale at the tip's centre, if no contacts in known places give it.",
)
@sensor_option
@click.option(
    "--prefer",
    type=click.Choice([p.value for p in Prefer]),
    default=Prefer.SPEED.value,
    show_default=True,
    help="speed: the smallest model as good as the best; accuracy: the best, or a process that is as good.",
)
@click.option(
    "--hold-out",
    type=FiniteFloat(min=0.01, max=0.9),
    help="Share of the poses to hold out; a fit to the others is evaluated on them, e.g. 0.2.",
)
@click.option(
    "--seed",
    type=WholeNumber(0, 2**31 - 1),
    default=0,
    show_default=True,
    help="Decides which poses are held out.",
)
@click.option(
    "--prior",
    type=PATH,
    metavar="FILE",
    help="Calibration of another tip: its models, changed as these frames say, are tried too.",
)
@click.option("--json", "as_json", is_flag=True, help="Print what was fitted as one JSON object.")
def fit_command(
    output: Path,
    overwrite: bool,
    serial: str,
    mm_per_px: float | None,
    sensor_name: str | None,
    prefer: str,
    hold_out: float | None,
    seed: int,
    prior: Path | None,
    as_json: bool,
    **frames: Any,
) -> None:
    """Fit a calibration to frames with known truth.

    TABLE is a TARGETS.csv, with --frames and --rest, or one or more captures (.mcap) of one tip.

    Columns of TARGETS.csv: sensor_image and any of pose_z (mm), pose_Rx, pose_Ry (deg), shear_x, shear_y
    (mm), shear_Rz (deg), force_x, force_y, force_z (N), torque_z (N mm), area (mm2), contact_x, contact_y,
    contact_depth (mm). What has no column is not fitted. The scale comes from contacts in known places, from
    --mm-per-px, or from the pitch of --sensor; without any, what is in mm of the image (places, slip speed)
    stays invalid. With --hold-out, a share of the poses is held out first: a fit to the others is evaluated
    on them. The file is then fitted to all frames. Dots on the skin's surface are named by --sensor, or found
    from contacts in known places, if they are a square grid. With --prior, a new tip needs only a few frames.
    """
    given = Frames(**frames)
    check_output(output, (".json",), [*given.inputs, *([prior] if prior else [])], overwrite)
    known = [_known_of_view(prior, view.content) for view in Calibration.load(prior).views] if prior else [{}]
    skin = None if sensor_name is None else load_sensor(sensor_name).tip.skin
    views = given.open().read_as(on_surface=skin == "surface").views()
    if prior:
        _check_prior(prior, known, views)
    fitted: list[_Fitted] = []
    for k, view in enumerate(views):
        if len(views) > 1:
            click.echo(f"view {k + 1} of {len(views)}, {counted(len(view.rest), 'pin')}", err=True)
        data, targets, extract = _of_its_skin(given, view, skin)
        scale = mm_per_px or scale_of(sensor_name, data.rest)
        held_out = None if hold_out is None else (hold_out, seed)
        search = Search(Prefer(prefer), known=known[k % len(known)])
        fitted.append(_fitted(given, data, targets, extract, search, serial, scale, held_out))
    calibration = of_views([one.calibration for one in fitted])
    with writing(output, overwrite) as unfinished:
        unfinished.write_bytes(calibration.encoded)
    if as_json:
        found = [one.as_json for one in fitted]
        click.echo(json.dumps({"output": str(output)} | ({"views": found} if len(found) > 1 else found[0])))
        return
    for k, one in enumerate(fitted):
        print_choices(
            one.choices, f"{output}, view {k + 1} of {len(fitted)}" if len(fitted) > 1 else str(output)
        )
        if one.held_out is not None:
            title = f"a fit to the other frames, on held-out ones ({hold_out:g}, seed {seed})"
            print_report(one.held_out, title)
            click.echo(f"{output} is fitted to all frames.")


@dataclass(frozen=True, slots=True)
class _Fitted:
    """The calibration of one view, how each model was chosen, and what was said of it.

    held_out  errors on frames held out; None: they were not asked for
    """

    calibration: Calibration
    choices: list[Choice]
    warnings: list[str]
    held_out: dict[str, Any] | None

    @property
    def as_json(self) -> dict[str, Any]:
        found = {"models": [_row(choice) for choice in self.choices], "warnings": self.warnings}
        return found if self.held_out is None else found | {"held_out": self.held_out}


def _fitted(
    given: Frames,
    data: Dataset,
    targets: Targets,
    extract: Extract,
    search: Search,
    serial: str,
    mm_per_px: float | None,
    hold_out: tuple[float, int] | None,
) -> _Fitted:
    """Fit one view; hold_out: the share of the poses, and the seed."""
    held_out = None
    with executor(given.dask, given.workers) as pool, progress_bar(given.quiet) as bar:
        if hold_out is not None:
            held_out = evaluate_held_out(data.rest, targets, extract, *hold_out, search=search, pool=pool)
        task = bar.add_task("models", total=len(groups_of(targets)))
        calibration, choices = fit(
            data.rest,
            targets,
            extract,
            serial=serial,
            estimated=data.estimated,
            mm_per_px=mm_per_px,
            on_part=lambda groups: bar.advance(task, groups),
            on_refused=lambda why: click.echo(f"not fitted: {why}", err=True),
            on_axes=_print_axes,
            search=search,
            pool=pool,
        )
    return _Fitted(calibration, choices, _warned(list(fit_warnings(targets, extract, choices))), held_out)


def _of_its_skin(given: Frames, data: Dataset, skin: str | None) -> tuple[Dataset, Targets, Extract]:
    """The data, the truth, and the frames read as the skin needs: the sensor's, or one that is found."""
    targets, extract = given.extract(data)
    of_dots = None if skin else extract_of_dots(data, targets, extract, given.measured)
    if of_dots is None:
        return data, targets, extract
    click.echo("skin: dots on its surface, by the places of the contacts", err=True)
    return data.read_as(on_surface=True), targets, of_dots


def scale_of(name: str | None, rest: Rest) -> float | None:
    """Scale by the pitch of a sensor. Raises ConfigError: not known, or the pins are not in its layout."""
    if name is None:
        return None
    sensor = load_sensor(name)
    scale = scale_by_pitch(sensor, rest)
    if scale is None:
        why = "its file has no pitch_mm" if sensor.pins.pitch_mm is None else "the pins are not in its layout"
        raise ConfigError(f"--sensor {name}: no scale follows from it, {why}; give --mm-per-px")
    return scale


def _known_of_view(prior: Path, content: CalibrationFile) -> dict[tuple[str, ...], KnownModel]:
    """The models of a view of another tip. Raises CalibrationError: nothing carries over."""
    known = known_models(content)
    if not known:
        raise CalibrationError(
            f"{prior}: has no process and no polynomial, which alone carry over to another tip; fit it again "
            "with --prefer accuracy"
        )
    left = [name for model in content.models for name in outputs_of(model) if not is_of_contact(model)]
    left = [name for name in left if not any(name in outputs for outputs in known)]
    if left:
        click.echo(f"{prior}: {', '.join(left)}: a curve does not carry over to another tip", err=True)
    return known


def _check_prior(prior: Path, known: list[dict[tuple[str, ...], KnownModel]], views: list[Dataset]) -> None:
    """Raises CalibrationError: it is of other views, or of values that these frames tell nothing of."""
    if len(known) not in (1, len(views)):
        raise CalibrationError(
            f"{prior}: is of {len(known)} views, the frames show {len(views)}; see --region"
        )
    wanted = [name for group in groups_of(views[0].targets) for name in group.outputs]
    if not any(name in outputs for of_view in known for outputs in of_view for name in wanted):
        raise CalibrationError(
            f"{prior}: has no model of {', '.join(wanted)}, the truth of these frames; give the calibration "
            "of a tip that has one, or leave --prior out"
        )


def _print_axes(axes: Axes) -> None:
    for line in axes.lines:
        click.echo(f"axes: {line}", err=True)
    _warned(list(axes.warnings))


def _warned(lines: list[str]) -> list[str]:
    """The same, printed."""
    for line in lines:
        click.echo(f"warning: {line}", err=True)
    return lines


def _row(choice: Choice) -> dict[str, Any]:
    return {
        "outputs": choice.outputs,
        "model": choice.chosen.name,
        "terms": choice.chosen.n_terms,
        "rms_held_out": choice.chosen.rms,
        "rms_allowed": choice.allowed,
        "best_of_kinds": {kind: c.rms for kind, c in choice.best_of_kinds.items()},
        "sigma": choice.model.sigma,
        "tried": len(choice.tried),
    }


def print_choices(choices: list[Choice], of: str) -> None:
    """A table of what was fitted."""
    # Narrow enough for 80 columns: a terminal's usual width, and that of a pipe.
    table = Table(title=f"{of}: what was fitted", box=box.SIMPLE, padding=0, pad_edge=False)
    table.caption = (
        "Errors are rms over the cross-validation, in the value's unit. Up to the limit a model is as good "
        "as the best; the smallest of these is chosen. Sigma is a typical frame's; a reading's own "
        "is larger where few frames were near it."
    )
    for name in ("value", "model chosen", "terms", "error", "limit", "best of each kind", "sigma"):
        table.add_column(name, no_wrap=name != "model chosen")
    for choice in choices:
        table.add_row(*choice.cells("\n"))
    Console().print(table)
