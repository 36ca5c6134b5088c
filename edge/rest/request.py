"""Requests for a rest frame, and the outcome of the last one.

    ask() -> images are collected -> a job takes and checks the rest frame -> accepted or refused
                                     (another thread; the loop goes on with the old rest frame)

Requests come from any thread; everything else is the loop's.
"""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from edge.calibration import Calibration
from edge.errors import RequestRefused
from edge.frame import Pipeline
from edge.rest.tare import RestFrame
from edge.types import Frame
from hostlink.wire import RestFrameReason, RestFrameState


@dataclass(frozen=True, slots=True)
class TareOutcome:
    """Outcome of request `number`; 0: there was none yet."""

    number: int = 0
    state: RestFrameState = RestFrameState.UNKNOWN
    reason: RestFrameReason = RestFrameReason.NONE
    message: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class TareRequest:
    """A request for a new rest frame."""

    number: int
    force: bool = False  # accept it although it shows a touch
    calibration: Calibration | None = None  # to be used from then on; None: the present one stays
    store: Callable[[], None] | None = None  # called before it is used. Raises OSError
    done: Future[TareOutcome] = field(default_factory=Future)  # gets the outcome


#: Result of a job: a rest frame, the stages that measure against it, the last image that it was made from.
Prepared = tuple[RestFrame, Pipeline, Frame]


class TareState:
    """The rest frame that is being taken, and the outcome of the last request.

    outcome  of the last request; replaced as a whole, so that any thread may read it
    frames   collected so far; None: none is being taken
    job      checks them, or has, and its result was not fetched; None: there is none

    At its start a finger takes one without a request.
    """

    def __init__(self, frames_n: int) -> None:
        self.outcome = TareOutcome()
        self.frames: list[Frame] | None = []
        self.request: TareRequest | None = None
        self.in_thread = False  # whether rest frames are checked in another thread, while the loop goes on
        self._frames_n = frames_n
        self._lock = threading.Lock()
        self.job: Future[Prepared] | None = None

    @property
    def busy(self) -> bool:
        """Whether a rest frame is being taken or checked."""
        return self.frames is not None or self.job is not None

    def ask(
        self,
        force: bool = False,
        calibration: Calibration | None = None,
        store: Callable[[], None] | None = None,
    ) -> TareRequest:
        """Have a rest frame taken from the next images. From any thread. Raises RequestRefused."""
        with self._lock:
            if self.request is not None:
                raise RequestRefused("a rest frame is being taken already; ask again when it is done")
            request = TareRequest(self.outcome.number + 1, force, calibration, store)
            self.outcome = TareOutcome(request.number, RestFrameState.BUSY)
            self.request = request
        return request

    # ---- the loop's thread --------------------------------------------------------------------------

    def collect(self, frame: Frame, usable: bool) -> list[Frame] | None:
        """Keep a usable image, if a rest frame is wanted; return all once there are enough."""
        if self.job is not None:
            return None
        if self.frames is None and self.request is not None:
            self.frames = []
        if self.frames is None or not usable:
            return None
        self.frames.append(frame)
        return self.frames if len(self.frames) >= self._frames_n else None

    def start(self, job: Callable[[], Prepared], afterwards: Callable[[Pipeline], None]) -> None:
        """Check the collected images: at once, or in another thread.

        afterwards  what that other thread does once the loop may measure with the pipeline
        """
        self.frames, self.job = None, Future()
        if self.in_thread:
            threading.Thread(target=_run, args=(job, self.job, afterwards), name="tare", daemon=True).start()
        else:
            _run(job, self.job)

    @property
    def checked(self) -> bool:
        return self.job is not None and self.job.done()

    def result(self) -> Prepared:
        """The job's result. Raises TareRefused, or the job's own error."""
        assert self.job is not None
        job, self.job = self.job, None
        return job.result()

    def finish(self, state: RestFrameState, reason: RestFrameReason, message: str) -> None:
        """Complete the request, if there is one."""
        with self._lock:
            request, self.request = self.request, None
            if request is not None:
                self.outcome = TareOutcome(request.number, state, reason, message)
        self.frames = None
        if request is not None:
            request.done.set_result(self.outcome)

    def close(self) -> None:
        """No more images come: refuse requests. A job under way is abandoned."""
        self.job = None
        if self.request is not None:
            self.finish(RestFrameState.REFUSED, RestFrameReason.NO_IMAGES, "the program ends")


def _run(
    job: Callable[[], Prepared],
    outcome: Future[Prepared],
    afterwards: Callable[[Pipeline], None] = lambda _: None,
) -> None:
    try:
        prepared = job()
    except Exception as error:  # noqa: BLE001  (`TareState.result` raises it)
        outcome.set_exception(error)
    else:
        outcome.set_result(prepared)
        afterwards(prepared[1])
