"""`python -m hostlink.wire.generate`: writes the files, or with --check says which are stale."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hostlink.wire.generate import ROOT, generate


def main() -> int:
    """Exit code 0; 1: --check found a stale file; 2: wrong arguments, or a library is missing."""
    parser = argparse.ArgumentParser(prog="python -m hostlink.wire.generate", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a file is stale")
    parser.add_argument("--out", type=Path, default=ROOT, help="folder to write to (the package's)")
    arguments = parser.parse_args()
    try:
        files = generate()
    except ImportError as error:
        parser.error(f"{error}: pip install -e '.[dev]'")
    stale = 0
    for name, text in files.items():
        path = arguments.out / name
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        stale += 1
        if arguments.check:
            print(f"stale: {path}", file=sys.stderr)
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path}")
    return 1 if arguments.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
