"""Names and sentences use the field's terms: words that were replaced do not return."""

import re
import tokenize
from functools import partial
from pathlib import Path

from tests.support.processes import source_files

ROOT = Path(__file__).resolve().parent.parent
#: Parts of names, as in `_tell_of_link`: no name may contain one, in any package or test.
PARTS = {
    "believed", "doubt", "doubtful", "heard", "mend", "mourn", "rival", "soundness", "starve", "surprise",
    "told", "torn", "usual", "vitals", "witnessed",
}  # fmt: skip
#: Names of tests say what they prove, not that something is told.
NOT_IN_TEST_NAMES = (
    r"(^test_what_|_told\b|_told_|_says?_so|_said\b|_said_|_felt|_hears?_|_besides|_for_granted)"
)
#: These words and phrases may not stand even in a sentence.
NOT_IN_SENTENCES = (
    "aside", "mends?", "mended", "doubt", "doubtful", "mourns?", "vitals", "starved?", "told apart",
    "(is|are|was|were) told", "no news", "nobody (will|can) (hear|know)", "bears? witness",
    "is no answer", "let(s|ting)? go of", "has no say", "throw(s|n)? away", "taken? off",
    "wait(s|ing)? for each other",
)  # fmt: skip


files = partial(source_files, ROOT)


THIS = Path(__file__).resolve()
CODE = [path for path in files("edge/*.py", "hostlink/*.py", "calib/*.py", "tests/*.py") if path != THIS]
PROSE = [path for path in files("*.py", "*.md", "*.toml", "*.sh", "*.js") if path != THIS]


def names_in(path: Path) -> set[str]:
    """Every name in a module."""
    with tokenize.open(path) as text:
        return {word for kind, word, *_ in tokenize.generate_tokens(text.readline) if kind == tokenize.NAME}


def parts_of(name: str) -> set[str]:
    """`_torn_neighbours`, `TornNeighbours` -> torn, neighbours."""
    return {part.lower() for part in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)}


def test_no_old_name_is_left() -> None:
    wrong = []
    for path in CODE:
        where = path.relative_to(ROOT).as_posix()
        for name in sorted(names_in(path)):
            if parts_of(name) & PARTS:
                wrong.append(f"{where}: {name} was replaced by a term of the field")
            if name.startswith("test_") and re.search(NOT_IN_TEST_NAMES, name):
                wrong.append(f"{where}: {name}: say what it proves")
    assert not wrong


def test_no_old_word_is_left_in_sentences() -> None:
    phrases = re.compile(rf"\b(?:{'|'.join(NOT_IN_SENTENCES)})\b")
    for path in PROSE:
        text = " ".join(path.read_text(encoding="utf-8").lower().split())
        found = [text[max(one.start() - 40, 0) : one.end() + 40] for one in phrases.finditer(text)]
        assert not found, path.relative_to(ROOT)
