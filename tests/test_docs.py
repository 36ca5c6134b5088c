"""The documentation builds without a warning, and every link within the project has a target."""

import re
from pathlib import Path

import pytest

from tests.support.processes import python, source_files

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?<!!)\[[^\]]+\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
PAGES = source_files(ROOT, "*.md")


def anchors(page: Path) -> set[str]:
    """Names of the headings of a page in links."""
    titles = re.findall(r"^#+ +(.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_have_targets(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in (first or second for first, second in LINK.findall(text)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), f"{page.name}: {target} is not there"
        if anchor:
            assert anchor in anchors(file), f"{page.name}: no heading {anchor} in {file.name}"


def test_pages_build_without_a_warning(tmp_path: Path) -> None:
    sphinx = ("-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-b", "html")
    build = python(*sphinx, "-d", tmp_path / "trees", "docs", tmp_path / "html", cwd=ROOT)
    assert build.returncode == 0, build.stderr
    assert (tmp_path / "html" / "api.html").is_file()


def test_every_test_that_security_names_exists() -> None:
    names = set(re.findall(r"`(test_\w+)`", (ROOT / "SECURITY.md").read_text()))
    defined = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(), re.MULTILINE)
    }
    assert names
    assert names <= defined
