"""Commands that read or set: info, tare, set, busload."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click
from click.core import ParameterSource

from hostlink.cli_types import FiniteFloat, WholeNumber, counted
from hostlink.client import Finger, connect
from hostlink.commands.busload import LIMIT, Load, plan
from hostlink.errors import LinkError, ObjectAborted, RestFrameRefused, UsageError
from hostlink.finger import read_upload
from hostlink.wire import OBJECTS, Abort, Object, RestFrameState, object_named, pack_value
from hostlink.wire.objects import REST_FRAME_REASONS, REST_FRAME_STATES, RestFrameReason

finger_option = click.option(
    "--finger", type=WholeNumber(1, 127), help="Node number; not needed where there is only one finger."
)


@click.command()
@click.argument("address")
@finger_option
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
def info(address: str, finger: int | None, as_json: bool) -> None:
    """Identity, settings and statistics of a finger."""
    with connect(address) as hand:
        answer = hand.finger(finger).info()
    values = {"software_version": answer.software_version, **answer.values}
    if as_json:
        click.echo(json.dumps(values))
        return
    for name, value in values.items():
        shown = f"0x{answer.schema_hash:08x}" if name == "schema_hash" else _shown(value)
        meaning = _MEANING.get(name, {}).get(value)
        text = f"{name:<20} {shown} {object_named(name).unit}".rstrip()
        click.echo(f"{text}: {meaning}" if meaning else text)


#: Meanings of values that do not speak for themselves, by name of the object.
_MEANING: dict[str, Mapping[Any, str]] = {
    "rate_hz": {0.0: "no limit, a sample for each image"},
    "detail_divider": {0: "off"},
    "heartbeat_ms": {0: "off"},
    "rest_frame_state": REST_FRAME_STATES,
    "rest_frame_reason": REST_FRAME_REASONS,
}


def _shown(value: int | float | str | bytes) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@click.command()
@click.argument("address")
@finger_option
@click.option("--force", is_flag=True, help="Even if something touches the tip.")
def tare(address: str, finger: int | None, force: bool) -> None:
    """Take the rest frame (tare) anew, and wait until it is in use.

    Refused, with exit code 1, where the images show a touch; the rest frame before stays in use then.
    """
    with connect(address) as hand:
        asked = hand.finger(finger)
        try:
            outcome = asked.tare(force)
        except (ObjectAborted, RestFrameRefused) as error:
            if error.reason is RestFrameReason.TOUCHED or "force the tare" in str(error):
                raise LinkError(f"{error}; --force takes it anyway") from None
            raise
    if outcome.state is RestFrameState.FORCED:
        message = outcome.message or REST_FRAME_REASONS[outcome.reason]
        click.echo(f"finger {asked.node}: rest frame forced: {message}")
    else:
        click.echo(f"finger {asked.node}: new rest frame in use")


#: A finger answers one of these to a value or a file that it cannot use.
_UNUSABLE = frozenset({Abort.VALUE_RANGE, Abort.VALUE_LOW, Abort.VALUE_HIGH, Abort.LENGTH})


@contextmanager
def _mistakes(what: str) -> Iterator[None]:
    """Report a refused value as the user's mistake, not as the finger's failure."""
    try:
        yield
    except ObjectAborted as error:
        if error.code in _UNUSABLE:
            raise UsageError(f"{what}: {error.reason}") from None
        raise


@click.command("set", context_settings={"ignore_unknown_options": True})  # -5 is a value
@click.argument("address")
@click.argument("name")
@click.argument("value")
@finger_option
def set_object(address: str, name: str, value: str, finger: int | None) -> None:
    """Set object NAME of a finger: rate_hz, divider, features, heartbeat_ms, detail_divider, ...

    For `calibration` VALUE is a file; the command waits until it is in use, with a new rest frame.
    """
    try:
        obj = object_named(name)
    except KeyError:
        known = ", ".join(o.name for o in OBJECTS if o.access in ("rw", "wo"))
        raise UsageError(f"no object {name!r}; what can be set: {known}") from None
    if obj.access not in ("rw", "wo"):
        raise UsageError(f"{name} can only be read; see `python -m hostlink info`")
    if obj.type == "domain":
        data = read_upload(value)  # before a bus is opened for it
        with connect(address) as hand:
            asked = hand.finger(finger)
            with _mistakes(f"{value}: refused by finger {asked.node}"):
                asked.upload_calibration(data)
        click.echo(f"finger {asked.node}: {name} = {value}, new rest frame in use")
        return
    try:
        number = float(value) if obj.type == "real32" else int(value, 0)
    except ValueError:
        raise UsageError(f"{name} takes {_range_of(obj)}, not {value!r:.40}") from None
    try:
        pack_value(obj, number)
    except ValueError as error:  # before a bus is opened for it
        raise UsageError(str(error)) from None
    with connect(address) as hand:
        asked = hand.finger(finger)
        with _mistakes(f"{name} = {value}: refused by finger {asked.node}"):
            asked.set(name, number)
        shown = _shown(asked.get(name) if obj.access == "rw" else number)
        stored = not obj.stored or _stores_settings(asked)
    until = "" if stored else " (until the finger restarts: it has no folder to store settings in)"
    click.echo(f"finger {asked.node}: {name} = {shown} {obj.unit}".rstrip() + until)


def _range_of(obj: Object) -> str:
    """The numbers that an object takes, in words."""
    kind = "a number" if obj.type == "real32" else "a whole number"
    if obj.low is None or obj.high is None:
        return kind
    return f"{kind} from {obj.low:g} to {obj.high:g}{' ' * bool(obj.unit)}{obj.unit}"


def _stores_settings(finger: Finger) -> bool:
    try:
        return bool(finger.get("settings_stored"))
    except ObjectAborted:  # an older release without this object
        return True


@click.command()
@click.option("--fingers", type=WholeNumber(1, 127), default=1, show_default=True, help="On the bus.")
@click.option(
    "--rate",
    "rate_hz",
    type=FiniteFloat(0, 2000, min_open=True),
    default=250.0,
    show_default=True,
    help="Samples a second of each finger.",
)
@click.option("--bitrate", type=WholeNumber(10_000, 1_000_000), default=1_000_000, show_default=True)
@click.option(
    "--dbitrate",
    type=WholeNumber(10_000, 8_000_000),
    default=5_000_000,
    show_default=True,
    help="Bits a second in the data phase of CAN FD.",
)
@click.option("--classic", is_flag=True, help="Classic CAN: parts of 8 bytes.")
@click.option("--baud", type=WholeNumber(9_600, 12_000_000), help="A serial line instead of a bus.")
@click.pass_context
def busload(
    ctx: click.Context,
    fingers: int,
    rate_hz: float,
    bitrate: int,
    dbitrate: int,
    classic: bool,
    baud: int | None,
) -> None:
    """How full a bus gets, with worst-case stuffing. What cannot fit is refused, with what would."""
    _refuse_of_another_link(ctx, "--baud" if baud is not None else "--classic" if classic else "")
    if baud is not None:
        load = plan("serial", fingers, rate_hz, baud)
    elif classic:
        load = plan("classic", fingers, rate_hz, bitrate)
    else:
        if dbitrate < bitrate:
            raise UsageError(
                f"--dbitrate {dbitrate} is slower than --bitrate {bitrate}: the data phase is the fast one"
            )
        load = plan("fd", fingers, rate_hz, bitrate, dbitrate)
    if not load.fits:
        would = "; ".join(load.advice) or "nothing within CAN's rates: use more buses"
        raise UsageError(f"{_sentence(load)}; at most {LIMIT:.0%} is planned. What fits: {would}")
    click.echo(_sentence(load))


#: Each kind of link has no use for these.
_NOT_OF = {"--baud": ("classic", "bitrate", "dbitrate"), "--classic": ("dbitrate",)}


def _refuse_of_another_link(ctx: click.Context, kind: str) -> None:
    """Raises UsageError: an option was given that this kind of link would leave unused."""
    for name in _NOT_OF.get(kind, ()):
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise UsageError(f"--{name} does not go with {kind}: leave one of them out")


def _sentence(load: Load) -> str:
    where = {
        "fd": f"CAN FD {load.bitrate / 1e6:g}/{(load.dbitrate or 0) / 1e6:g} Mbit/s",
        "classic": f"classic CAN {load.bitrate / 1e6:g} Mbit/s",
        "serial": f"serial {load.bitrate} baud",
    }[load.kind]
    each = " each, a line for each," if load.kind == "serial" and load.fingers > 1 else ""
    return (
        f"{where}: {counted(load.fingers, 'finger')} at {load.rate_hz:g} Hz{each} "
        f"take{'s' * (load.fingers == 1)} {load.share:.1%} ({load.sample_s * 1e6:.0f} us a sample at worst)"
    )
