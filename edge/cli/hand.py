"""`edge hand`: the fingers of one OAK module, each a process of its own.

This process opens the module and hands each camera's frames on to the process of its finger. Frames of one
exposure have one number. None waits until its set is complete, which would delay the first by the transfer of
all others. A finger that does not read loses frames, the others lose none.
"""

import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import click
from msgspec.structs import asdict

from edge.cli.options import PATH
from edge.config import load_config
from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources.oak import OakCamera, OakModule, Opened, camera_at, find_module
from edge.sources.oak_hand import FEED_VARIABLE
from edge.sources.options import Options, parse_spec
from edge.sources.shared_memory import Outbox
from hostlink.interrupt import calling_on_signals

log = logging.getLogger("edge")


class _Finger:
    """The process of a finger, and what it gets its images through."""

    def __init__(self, config: Path, camera: OakCamera) -> None:
        self._config, (width, height) = config, camera.options.size_px
        self._memory_bytes = RUNTIME.sample_n * width * height
        self._start()

    def _start(self) -> None:
        self._started_s = time.monotonic()
        self.outbox = Outbox(self._memory_bytes)  # a new one: what the last process has not read is old
        fds = self.outbox.far_end.fileno(), self.outbox.fd
        # The service's watchdog asks this process alone; each finger tells it that images flow.
        inherited = {name: value for name, value in os.environ.items() if name != "WATCHDOG_PID"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "edge", "run", "--config", self._config],
            pass_fds=fds,
            env=inherited | {FEED_VARIABLE: f"{fds[0]},{fds[1]}"},
        )
        self.outbox.far_end.close()

    def goes_on(self) -> bool:
        """False: it has ended, or its user made a mistake. If it died it is started again, once a second."""
        code = self.process.poll()
        if code and code != 2 and time.monotonic() > self._started_s + RUNTIME.patience_s:
            log.warning("%s: its process ended with code %d and is started again", self._config, code)
            self.outbox.close()
            self._start()
        return code not in (0, 2)


def _cameras(configs: Sequence[Path]) -> tuple[str, list[OakCamera]]:
    """The module's address, and a camera for each configuration. Raises ConfigError, SourceError."""
    where, cameras = None, dict[str, OakCamera]()
    for config in configs:
        settings = asdict(load_config(config).source)
        spec = parse_spec(settings.pop("spec"), Options(**settings))
        if spec.scheme != "oak" or where not in (None, spec.where):
            raise SourceError(f"{config}: {spec.text}: a hand has one module; give oak:ID?socket=...")
        where, camera = spec.where, camera_at(spec.where, spec.options)
        socket = camera.keys.socket
        if socket in cameras:
            raise SourceError(f"{config}: {spec.text}: {socket} is another finger's; give ?socket=")
        cameras[socket] = camera
    return where or "", list(cameras.values())


def hand_on(module: OakModule, opened: Opened | None, outboxes: Sequence[Outbox]) -> Opened | None:
    """Hand on what comes within a moment: to each finger the lens and frame of its camera.

    opened   None: the module was lost, and is opened if it is back
    Returns  the same for the next time
    """
    try:
        opened = opened or module.open()
    except (SourceError, RuntimeError):  # still away, or booting
        return None
    frames = module.read(opened)
    for place, outbox in enumerate(outboxes):
        if frames is None or place in frames:
            outbox.put((module.lenses[place], frames[place] if frames else None))  # no frame: it is lost
    if frames is None:
        module.shut(opened)
        return None
    return opened


@click.command()
@click.argument("configs", nargs=-1, required=True, type=PATH, metavar="CONFIG...")
def hand(configs: tuple[Path, ...]) -> None:
    """Run the fingers of a hand whose cameras are on one OAK module, until stopped.

    Each CONFIG is that of a finger, for `edge run`, with a camera of its own: oak:?socket=CAM_A to CAM_D.
    """
    where, cameras = _cameras(configs)
    module = OakModule(cameras, lambda: find_module(where))
    opened: Opened | None = module.open()
    stopped = threading.Event()
    with calling_on_signals(stopped.set):
        fingers = [_Finger(*each) for each in zip(configs, cameras, strict=True)]
        while not stopped.is_set() and all(finger.goes_on() for finger in fingers):
            opened = hand_on(module, opened, [finger.outbox for finger in fingers])
        for finger in fingers:
            finger.outbox.close()
        if opened is not None:
            module.shut(opened)
        codes = [finger.process.wait() for finger in fingers]
    if any(codes):
        raise SystemExit(max(codes))
