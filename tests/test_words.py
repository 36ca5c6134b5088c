"""Names and sentences use the field's terms: words that were replaced do not return."""

import ast
import re
from functools import partial
from pathlib import Path

from tests.support.processes import source_files

ROOT = Path(__file__).resolve().parent.parent
#: Names of modules and folders that were replaced.
MODULES = {
    "aside", "tape", "recorded", "leave", "threads", "notify", "track", "tessellate", "transport", "draw",
}  # fmt: skip
#: Names in code that were replaced.
RENAMED = {
    "Health", "Vitals", "Faults", "Moments", "Refiner", "VALLEY", "PART", "app", "apps", "effort", "bend",
    "blank", "beat", "feed", "growth", "grown", "heard", "hear", "lead", "light", "look", "Look", "loose",
    "news", "relief", "rise", "room", "said", "stretch", "sure", "tell", "told", "touched", "unsure",
    "watchers", "words",
}  # fmt: skip
#: These words are free in the names of tests, where they are plain English.
IN_SOURCES_ONLY = {"feed", "light", "look", "stretch", "touched", "words"}
#: Parts of names, as in `_tell_of_link`: no name may contain one, in any package or test.
PARTS = {
    "believed", "doubt", "doubtful", "heard", "mend", "mourn", "rival", "soundness", "starve", "surprise",
    "told", "torn", "usual", "vitals", "witnessed",
}  # fmt: skip
#: Names of tests say what they prove, not that something is told.
NOT_IN_TEST_NAMES = (
    r"(^test_what_|_told\b|_told_|_says?_so|_said\b|_said_|_felt|_hears?_|_besides|_for_granted)"
)
#: In these files a word is the field's own in another sense, or part of a format.
ALLOWED = {
    "calib/rig/simulated.py": {"look"},  # a table of the rig's file
    "calib/sim/render.py": {"light"},  # of the lamp
    "calib/sim/source.py": {"light"},  # of the lamp
    "edge/recording/mcap_file.py": {"tell"},  # of a file object
    "edge/worker/client.py": {"feed"},  # the recording's or the viewers' feed
    "hostlink/wire/generate/doc.py": {"room"},  # in a frame
    "tests/bench/hazards.py": {"unsure"},  # a column of its table
    "tests/bench/soak.py": {"growth", "tell"},  # of memory; of a report
    "tests/bench/videos.py": {"sure", "unsure"},  # a column of its table
    "tests/hostlink/wire/test_c_receiver.py": {"tell"},  # names of the C program
}
#: These words and phrases may not stand even in a sentence.
NOT_IN_SENTENCES = (
    "aside", "mends?", "mended", "doubt", "doubtful", "mourns?", "vitals", "starved?", "told apart",
    "(is|are|was|were) told", "no news", "nobody (will|can) (hear|know)", "bears? witness",
    "is no answer", "let(s|ting)? go of", "has no say", "throw(s|n)? away", "taken? off",
    "wait(s|ing)? for each other",
)  # fmt: skip


files = partial(source_files, ROOT)


THIS = Path(__file__).resolve()
SOURCES = files("edge/*.py", "hostlink/*.py", "calib/*.py")
CODE = [path for path in [*SOURCES, *files("tests/*.py")] if path != THIS]
PROSE = [path for path in files("*.py", "*.md", "*.toml", "*.sh", "*.js") if path != THIS]


def names_in(path: Path) -> set[str]:
    """Every name that a module makes: of functions, classes, arguments, variables, attributes."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr)
    return names


def parts_of(name: str) -> set[str]:
    """`_torn_neighbours`, `TornNeighbours` -> torn, neighbours."""
    return {part.lower() for part in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)}


def test_no_old_name_is_left() -> None:
    wrong = []
    for path in CODE:
        where = path.relative_to(ROOT).as_posix()
        allowed = ALLOWED.get(where, set())
        old_names = RENAMED - allowed
        if where.startswith("tests/"):
            old_names -= IN_SOURCES_ONLY
        for name in sorted(names_in(path)):
            if name.strip("_") in old_names or parts_of(name) & PARTS - allowed:
                wrong.append(f"{where}: {name} was replaced by a term of the field")
            if name.startswith("test_") and re.search(NOT_IN_TEST_NAMES, name):
                wrong.append(f"{where}: {name}: say what it proves")
    assert not wrong


def test_no_old_module_is_left() -> None:
    packages = {part for path in SOURCES for part in (*path.relative_to(ROOT).parts[:-1], path.stem)}
    assert not packages & MODULES


def test_no_old_word_is_left_in_sentences() -> None:
    phrases = re.compile(rf"\b(?:{'|'.join(NOT_IN_SENTENCES)})\b")
    for path in PROSE:
        text = " ".join(path.read_text(encoding="utf-8").lower().split())
        found = [text[max(one.start() - 40, 0) : one.end() + 40] for one in phrases.finditer(text)]
        assert not found, path.relative_to(ROOT)
