"""Wrong arguments for every kernel: `python -m tests.fuzz.test_fuzz_kernels [--seconds S] [--seed N]`.

A short scene is played through the pipeline with every class and function of every kernel (the table in
setup.py) recorded: real constructors' arguments, real calls. Each is then repeated with one error in
it: an array's shape, type or layout, NaN, infinities, huge and negative numbers, nothing at all, an index out
of range.

Invariant: a kernel answers, or raises one of `REFUSALS`. It never crashes, hangs, or raises anything else.
A kernel that the scene does not reach is an error, too: add to `play`.
"""

import argparse
import copy
import dataclasses
import faulthandler
import importlib
import random
import reprlib
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from edge.errors import DegenerateLayout
from tests.support import kernels
from tests.support.processes import python

# The last: no array at all, one that must be writable, and points that span no plane.
REFUSALS = (ValueError, TypeError, OverflowError, AttributeError, BufferError, DegenerateLayout)
# Raised by the checked build; the others would access the memory.
OUT_OF_BOUNDS = "Out of bounds on buffer access"
SAMPLES = 4  # recorded calls of each function
RETRIES = 3  # calls of each object with one wrong argument each
NUMBERS = (0, -1, 1, 2, 7, 255, 2**31 - 1, 2**31, -(2**31), 2**40, 10**30)
REALS = (0.0, -0.0, -1.0, 0.5, 1e-300, 1e300, -1e300, float("nan"), float("inf"), float("-inf"))
DTYPES = (np.float64, np.float32, np.int32, np.int64, np.uint8, np.bool_, np.complex128)

Call = tuple[tuple[Any, ...], dict[str, Any]]


@dataclasses.dataclass
class Recorded:
    """Recorded use of one class or function.

    made   arguments that it was made (or, a function, called) with
    calls  method -> arguments, behind those that its object was made with
    """

    made: list[Call] = dataclasses.field(default_factory=list)
    calls: dict[str, list[tuple[Call, Call]]] = dataclasses.field(default_factory=dict)


def frozen(value: Any) -> Any:
    """A copy that later changes do not affect; kernels' own objects are not copied."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        return type(value)(map(frozen, value))
    return value


def exported(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Public classes with kernels' methods, and functions, that a module defines."""
    for name, item in vars(module).items():
        own = getattr(item, "__module__", None) == module.__name__
        if own and not name.startswith("_") and callable(item):
            yield name, item


@contextmanager
def recorded(modules: list[ModuleType]) -> Iterator[dict[Any, Recorded]]:
    """Until the block ends, each use of what these modules export is noted."""
    records: dict[Any, Recorded] = {}
    makers: dict[int, tuple[Any, Call]] = {}  # id of an object -> itself, and what it was made with
    with pytest.MonkeyPatch.context() as patched:
        for module in modules:
            for name, item in exported(module):
                record = records[item] = Recorded()
                if not isinstance(item, type):
                    for user in [one for one in sys.modules.values() if vars(one).get(name) is item]:
                        patched.setattr(user, name, noting_function(item, record))
                elif not _plain(item):
                    patched.setattr(item, "__init__", noting_maker(item, record, makers))
                    for own, method in list(vars(item).items()):
                        if not own.startswith("_") and callable(method):
                            record.calls[own] = []
                            patched.setattr(item, own, noting_method(method, record.calls[own], makers))
        yield records


def noting_function(function: Callable[..., Any], record: Recorded) -> Callable[..., Any]:
    def noted(*args: Any, **kwargs: Any) -> Any:
        if len(record.made) < SAMPLES:
            record.made.append((frozen(args), dict(kwargs)))
        return function(*args, **kwargs)

    return noted


def noting_maker(cls: type, record: Recorded, makers: dict[int, tuple[Any, Call]]) -> Callable[..., None]:
    initialise = cls.__init__  # type: ignore[misc]  # of this class, and wrapped for this class alone

    def noted(this: Any, *args: Any, **kwargs: Any) -> None:
        record.made.append((frozen(args), dict(kwargs)))
        makers[id(this)] = this, record.made[-1]
        initialise(this, *args, **kwargs)

    return noted


def noting_method(
    method: Callable[..., Any], calls: list[tuple[Call, Call]], makers: dict[int, tuple[Any, Call]]
) -> Callable[..., Any]:
    def noted(this: Any, *args: Any, **kwargs: Any) -> Any:
        if len(calls) < SAMPLES and id(this) in makers:
            calls.append((makers[id(this)][1], (frozen(args), dict(kwargs))))
        return method(this, *args, **kwargs)

    return noted


def play() -> None:
    """A scene that reaches every kernel."""
    from calib.extract import contact_inputs, frame_inputs
    from calib.sim.script import REST_FRAMES
    from edge.calibration import Calibration
    from edge.calibration.evaluation import ModelKernel, area_mm2
    from edge.faults import detector, frame_counts
    from edge.faults.registry import FaultRegistry
    from edge.frame import Pipeline
    from edge.link.state_packer import StatePacker
    from edge.pins import take_rest
    from edge.rest.tip_match import match_tip
    from tests.bench.frames import calibration_of, scene
    from tests.edge.calibration.test_evaluation import INPUTS, MODELS

    frames = scene("two", 61, (320, 240))[: REST_FRAMES + 40]
    calibration: Calibration = calibration_of(frames)
    rest = match_tip(calibration, take_rest([frame.image for frame in frames[:REST_FRAMES]]))[0]
    pipeline = Pipeline(rest, calibration)
    for frame in [*frames, frames[0], dataclasses.replace(frames[-1], image=frames[0].image * 0), frames[-1]]:
        result = pipeline.process(frame)
    features = result.features
    assert features is not None
    assert features.contacts
    frame_inputs(features, rest.pattern)
    contact_inputs(features.contacts[0], features, rest.pattern)
    frame_counts.level_of(frames[-1].image, 8)
    detector.common_step_px(features.displacement_px)
    source: Any = SimpleNamespace(live=True, name="", rate_hz=0.0)
    judge = detector.FaultDetector(source, FaultRegistry(), time.monotonic_ns)
    judge.begin(frames[-1], 10**9)
    judge.learn(rest, frames[-1], True)
    judge.judge(frames[-1], result, 0.0)
    StatePacker().to_state(result, 1, 0, 1)
    ModelKernel(INPUTS, MODELS)
    area_mm2(features.contacts, {}, 0.1)


def wrong_array(rng: random.Random, array: NDArray[Any]) -> Any:
    """One array with an error in it, or another kind of object."""
    flat = array.copy().reshape(-1)
    kind = rng.randrange(8)
    if kind == 0 and flat.size:  # a value
        values: tuple[Any, ...] = REALS if array.dtype.kind in "fc" else NUMBERS
        for _ in range(rng.choice((1, 1, flat.size))):
            flat[rng.randrange(flat.size)] = np.array(float(rng.choice(values))).astype(array.dtype)
        return flat.reshape(array.shape)
    if kind == 1 and flat.size and array.dtype.kind in "iu":  # an index just out of range
        below = -1 if array.dtype.kind == "i" else np.iinfo(array.dtype).max
        above = min(int(flat.max()) + rng.choice((1, 2)), int(np.iinfo(array.dtype).max))
        flat[rng.randrange(flat.size)] = rng.choice((below, above))
        return flat.reshape(array.shape)
    if kind == 2 and array.ndim:  # fewer or more rows
        axis = rng.randrange(array.ndim)
        size = max(0, array.shape[axis] + rng.choice((-1, 1, -array.shape[axis])))
        return np.ascontiguousarray(np.resize(array, (*array.shape[:axis], size, *array.shape[axis + 1 :])))
    if kind == 3:  # other dimensions
        return flat if array.ndim != 1 else flat[:, None].copy()
    if kind == 4 and array.dtype.names is None:
        return array.astype(rng.choice(DTYPES))
    if kind == 5 and array.ndim:  # strided
        return np.repeat(array, 2, axis=array.ndim - 1)[..., ::2]
    if kind == 6:
        locked = array.copy()
        locked.flags.writeable = False
        return locked
    return rng.choice((None, 3, "pins", [], np.empty((0,) * array.ndim, array.dtype)))


def wrong(rng: random.Random, value: Any) -> Any:
    """A value of the same kind with an error in it."""
    if type(value).__name__.endswith("Params"):  # chosen numbers, which no caller gives
        return value
    if isinstance(value, np.ndarray):
        return wrong_array(rng, value)
    if isinstance(value, bool):
        return rng.choice((not value, None, 2))
    if isinstance(value, int):
        return rng.choice(NUMBERS)
    if isinstance(value, float):
        return rng.choice(REALS)
    if isinstance(value, dict) and value:
        key = rng.choice(sorted(value))
        return {**value, key: wrong(rng, value[key])}
    if isinstance(value, msgspec.Struct):
        name = rng.choice(value.__struct_fields__)
        return msgspec.structs.replace(value, **{name: wrong(rng, getattr(value, name))})
    fields = getattr(value, "_fields", None) or list(getattr(value, "__dataclass_fields__", ()))
    if fields:
        name = rng.choice(fields)
        changed = wrong(rng, getattr(value, name))
        if hasattr(value, "_replace"):
            return value._replace(**{name: changed})
        other = copy.copy(value)
        object.__setattr__(other, name, changed)
        return other
    if isinstance(value, tuple | list) and value:
        k = rng.randrange(len(value))
        if rng.random() < 0.3:  # one too few, or too many
            return type(value)(rng.choice(([*value[:k], *value[k + 1 :]], [*value, value[k]])))
        return type(value)([*value[:k], wrong(rng, value[k]), *value[k + 1 :]])
    return value


def wrong_call(rng: random.Random, call: Call) -> Call:
    """The same call with one wrong argument."""
    args, kwargs = list(frozen(call[0])), dict(call[1])
    k = rng.randrange(len(args) + len(kwargs)) if args or kwargs else -1
    if 0 <= k < len(args):
        args[k] = wrong(rng, args[k])
    elif k >= 0:
        name = sorted(kwargs)[k - len(args)]
        kwargs[name] = wrong(rng, kwargs[name])
    return tuple(args), kwargs


class Fuzzer:
    """Repeats recorded calls with errors in them."""

    def __init__(self, records: dict[Any, Recorded], seed: int) -> None:
        self.records = {item: record for item, record in records.items() if record.made}
        self.rng = random.Random(seed)
        self.failures: dict[str, str] = {}
        self.answers = self.refusals = 0

    def run(self, seconds: float, rounds: int | None) -> None:
        end = time.monotonic() + seconds
        done = 0
        while done < rounds if rounds is not None else time.monotonic() < end:
            for item, record in self.records.items():
                self._one(item, record)
            done += 1

    def _one(self, item: Any, record: Recorded) -> None:
        name = name_of(item)
        made = self._try(name, item, wrong_call(self.rng, self.rng.choice(record.made)))
        for method, calls in record.calls.items():
            if not calls:
                continue
            maker, call = self.rng.choice(calls)
            if made is not None:  # with an error, and yet accepted
                self._try(f"{name}.{method}", getattr(made, method), call)
            one = item(*frozen(maker[0]), **maker[1])
            for _ in range(RETRIES):
                self._try(f"{name}.{method}", getattr(one, method), wrong_call(self.rng, call))
            self._try(f"{name}.{method}", getattr(one, method), call)

    def _try(self, name: str, work: Callable[..., Any], call: Call) -> Any:
        args, kwargs = frozen(call[0]), call[1]
        try:
            answer = work(*args, **kwargs)
            self.answers += 1
            return answer
        except REFUSALS:
            self.refusals += 1
        except Exception as error:  # noqa: BLE001  (that is what is looked for)
            if isinstance(error, LookupError) and OUT_OF_BOUNDS not in str(error):
                self.refusals += 1  # NumPy's own, or an unknown name
            else:
                self.failures.setdefault(f"{name}: {type(error).__name__}: {error}", reprlib.repr(call))
        return None


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rounds", type=int, help="this many instead of a time")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    kernels.install()
    faulthandler.enable()
    warnings.simplefilter("ignore")
    unraisable: list[str] = []
    sys.unraisablehook = lambda event: unraisable.append(f"{event.object}: {event.exc_value!r}")
    # The kernels of hostlink take bytes and numbers alone, which tests/hostlink/test_decoder.py makes wrong.
    names = [name for name in kernels.table().KERNELS if name.startswith("edge.")]
    modules = [importlib.import_module(name) for name in names]
    with recorded(modules) as records:
        play()
    unreached = [name_of(item) for item, record in records.items() if not record.made and not _plain(item)]
    fuzzer = Fuzzer(records, given.seed)
    fuzzer.run(given.seconds, given.rounds)
    for name in unreached:
        print(f"not reached: {name}")
    for failure, example in sorted(fuzzer.failures.items()):
        print(f"{failure}\n    called with {example}")
    for message in sorted(set(unraisable)):
        print(f"within a kernel: {message}")
    answered = f"{fuzzer.answers} answers, {fuzzer.refusals} refusals"
    print(f"{len(fuzzer.records)} kernels, seed {given.seed}: {answered}")
    return 1 if unreached or fuzzer.failures or unraisable else 0


def name_of(item: Any) -> str:
    return f"{item.__module__}.{item.__qualname__}"


def _plain(item: Any) -> bool:
    """Whether it is a record of values, which refuses nothing."""
    return dataclasses.is_dataclass(item) or hasattr(item, "_fields")


@pytest.mark.kernels
@pytest.mark.compiled
def test_no_kernel_crashes_on_wrong_arguments() -> None:
    """In a process of its own: a crash is a failed test. The checked build finds an index out of bounds."""
    done = python("-m", "tests.fuzz.test_fuzz_kernels", "--rounds", "25", cwd=kernels.ROOT)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


if __name__ == "__main__":
    sys.exit(main())
