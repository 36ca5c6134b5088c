"""A lens as a file: `calib lens` writes it, `?lens=FILE` in a source's address reads it."""

from pathlib import Path

from edge import limits
from edge.errors import SourceError
from edge.types import FrameSource, Lens

#: A source's address names so what the camera's maker measured.
FACTORY = "factory"


def load_lens(path: str | Path) -> Lens:
    """Raises SourceError, one line: cannot be read, or what is wrong in it."""
    try:
        return limits.read_toml_as(Path(path), Lens)[1]
    except limits.BadContent as error:
        raise SourceError(f"lens {path}: {error}; `python -m calib lens` makes one") from None


def lens_for(source: FrameSource, text: str) -> Lens | None:
    """The lens that an address asks for: of a file, "factory", or "" for none. Raises SourceError."""
    if not text:
        return None
    if text == FACTORY:
        lens = getattr(source, "factory_lens", None)
        if lens is None:
            raise SourceError(
                f"{source.name}: its maker's measurement of the lens is not known; give lens=FILE"
            )
    else:
        lens = load_lens(text)
    if source.size_px != (0, 0) and lens.size_px != source.size_px:
        made, now = ("{}x{}".format(*size) for size in (lens.size_px, source.size_px))
        raise SourceError(
            f"{source.name}: lens {text} was measured at {made}, the images are {now}; measure it at {now}"
        )
    return lens
