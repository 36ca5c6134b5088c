"""The report as one HTML page beside its pictures; no script, nothing from elsewhere."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from calib.fit import Choice
from edge.calibration.file import Curve
from hostlink.output_file import writing

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #20242c; max-width: 64rem;
  margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.6rem } h2 { font-size: 1.2rem; margin-top: 2.4rem; border-bottom: 1px solid #d5dae2 }
img { max-width: 100%; height: auto } table { border-collapse: collapse; font-size: .88rem; margin: .8rem 0 }
th, td { text-align: left; padding: .2rem .9rem .2rem 0; border-bottom: 1px solid #e6e9ee;
  vertical-align: top }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap }
tr.chosen { background: #fdeef0; font-weight: 600 }
details { margin: .4rem 0 } summary { cursor: pointer } code { font-size: .85em }
"""


@dataclass
class Section:
    """A heading, and what stands under it: paragraphs, pictures, tables (HTML)."""

    title: str
    parts: list[str] = field(default_factory=list)

    def text(self, text: str) -> None:
        self.parts.append(f"<p>{escape(text)}</p>")

    def picture(self, path: Path, what: str) -> None:
        self.parts.append(f'<p><img src="{escape(path.name)}" alt="{escape(what)}"></p>')

    def table(
        self,
        heads: Sequence[str],
        rows: Sequence[Sequence[str]],
        marked: Sequence[bool] = (),
        numbers_from: int = 1,
    ) -> None:
        """Cells are text; columns from `numbers_from` on are numbers, to the right."""
        kind = ["n" if i >= numbers_from else "" for i in range(len(heads))]
        head = "".join(f'<th class="{k}">{escape(h)}</th>' for h, k in zip(heads, kind, strict=True))
        body = []
        for i, row in enumerate(rows):
            cells = "".join(f'<td class="{k}">{escape(c)}</td>' for c, k in zip(row, kind, strict=True))
            body.append(f'<tr class="{"chosen" if i < len(marked) and marked[i] else ""}">{cells}</tr>')
        self.parts.append(f"<table><tr>{head}</tr>{''.join(body)}</table>")


@dataclass
class ReportPage:
    title: str
    sections: list[Section] = field(default_factory=list)

    def section(self, title: str) -> Section:
        self.sections.append(Section(title))
        return self.sections[-1]


def model_table(section: Section, choices: Sequence[Choice]) -> None:
    """Every model with its terms and weights: complete."""
    section.table(
        ("value", "model", "terms", "held-out rms", "limit", "best of each kind", "sigma", "models tried"),
        [(*choice.cells(", "), str(len(choice.tried))) for choice in choices],
        numbers_from=2,
    )
    for choice in choices:
        model = choice.model
        if isinstance(model, Curve):
            rows = "".join(
                f'<tr><td class="n">{x:.5g}</td><td class="n">{y:.4g}</td></tr>' for x, y in model.knots
            )
            inside = (
                f"<table><tr><th>{escape(model.input)}</th><th>{escape(model.output)}</th></tr>{rows}</table>"
            )
        else:
            order = sorted(zip(model.terms, model.weights, strict=True), key=lambda t: -abs(complex(*t[1])))
            rows = "".join(
                f"<tr><td><code>{escape(' · '.join(term) or '1')}</code></td>"
                f'<td class="n">{re:+.4g}</td><td class="n">{im:+.4g}</td></tr>'
                for term, (re, im) in order
            )
            inside = f"<table><tr><th>term</th><th>Re</th><th>Im</th></tr>{rows}</table>"
        tried = "; ".join(f"{c.name}: {c.n_terms} terms, {c.rms:.3g}" for c in choice.tried)
        section.parts.append(
            f"<details><summary>{escape(', '.join(choice.outputs))}: terms and weights</summary>{inside}"
            f"<p>Tried (held-out rms): {escape(tried)}</p></details>"
        )


def write_page(page: ReportPage, path: Path) -> None:
    """Write the page."""
    body = "".join(f"<h2>{escape(s.title)}</h2>{''.join(s.parts)}" for s in page.sections)
    with writing(path, overwrite=True) as unfinished:
        unfinished.write_text(
            f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(page.title)}</title>'
            f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style>'
            f"<h1>{escape(page.title)}</h1>{body}</html>\n",
            encoding="utf-8",
        )


def write_table(path: Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table of the report as CSV. Raises OutputError."""
    with (
        writing(path, overwrite=True) as unfinished,
        unfinished.open("w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file).writerows([head, *rows])
