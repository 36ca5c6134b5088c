"""Which tests a change asks for: `python -m tests.support.changed [REVISION]` prints folders and files.

Tests are foldered like the source, so that a change in `edge/cells` asks for `tests/edge/cells`. Whatever
changed, the quick tests of the whole house run too.
"""

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = Path("tests")
ALWAYS = ("tests/test_docs.py", "tests/test_house.py", "tests/test_tuned_numbers.py", "tests/test_words.py")


def changed_files(since: str) -> list[str]:
    """Files that differ from a revision, and those that git does not know yet."""
    commands = ["diff", "--name-only", since], ["ls-files", "--others", "--exclude-standard"]
    listed = [
        subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout
        for words in commands
    ]
    return "".join(listed).splitlines()


def paths_for(files: Iterable[str]) -> list[str]:
    """The nearest folder of tests of each file; of a module in a package's own folder its own tests."""
    found = set(ALWAYS)
    for file in map(Path, files):
        parts = file.parent.parts[file.parts[0] == "tests" :]
        while not (ROOT / TESTS).joinpath(*parts).is_dir():
            parts = parts[:-1]
        folder = TESTS.joinpath(*parts)
        own = folder / f"test_{file.stem.removeprefix('test_')}.py"
        if len(parts) <= 1 and (ROOT / own).is_file():
            found.add(own.as_posix())
        elif folder != TESTS:
            found.add(folder.as_posix())
    return sorted(path for path in found if not any(path.startswith(f"{other}/") for other in found))


if __name__ == "__main__":
    print(*paths_for(changed_files(sys.argv[1] if len(sys.argv) > 1 else "HEAD")))
