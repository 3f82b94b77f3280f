"""The table and the figure of `docs/make/structures.py`: from `docs/data` to `docs/structures.md`.

    python docs/make/structures_page.py

The table stands between two marks in the page, and a test holds it against the data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from stored import docs_folder, study_parser
from structures import DELAYS, HEARS_NO_PAYLOAD, LENGTHS, STRUCTURES, Row, read

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "structures.csv"
PAGE = ROOT / "docs" / "structures.md"
FIGURE = ROOT / "docs" / "images" / "structures.svg"
BEGIN, END = "<!-- structures: begin -->", "<!-- structures: end -->"
ROPES = (*(f"{length:g}" for length in LENGTHS), "one spring")
#: By which the figure tells structures apart: colour, mark.
LOOKS: Mapping[str, tuple[str, str]] = {
    "payload-feedback": ("#d55e00", "o"),
    "payload-feedback-rolloff": ("#e69f00", "v"),
    "drum-feedback": ("#009e73", "s"),
    "combined": ("#0072b2", "P"),
}

Rows = Mapping[tuple[str, str, str, float], Row]


def number(row: Row | None) -> str:
    """Return a cell: payload rms in mm, three digits; marked where the design is not ok."""
    if row is None:
        return "not computed"
    value = 1e3 * row.payload_rms
    text = f"{value:.0f}" if value >= 99.95 else f"{value:#.3g}".rstrip(".")
    return text if row.ok else f"({text})"


def table(rows: Rows) -> str:
    """Return the table in Markdown."""
    listed = list(rows.values())
    computed = {row.structure for row in listed}

    def find(rope: str, structure: str, link: str, delay: float | None = None) -> Row | None:
        return next(
            (
                row
                for row in listed
                if (row.rope, row.structure, row.link) == (rope, structure, link)
                and (delay is None or abs(row.delay - delay) < 1e-6)
            ),
            None,
        )

    delays = sorted(DELAYS)
    heads = [*(f"{1e3 * d:.0f} ms" for d in delays), "acoustic"]
    lines = [f"| rope | structure | {' | '.join(heads)} |", "| --- " * (len(heads) + 2) + "|"]
    for rope in ROPES:
        place = rope if rope == "one spring" else f"{rope} m"
        for structure in sorted(computed.intersection(STRUCTURES), key=_order):
            if structure in HEARS_NO_PAYLOAD:
                cells = [number(find(rope, structure, "any")), *[""] * len(delays)]
            else:
                cells = [number(find(rope, structure, "given", d)) for d in delays]
                far = find(rope, structure, "acoustic")
                cells.append("" if rope == "one spring" else number(far))
            lines.append(f"| {place} | `{structure}` | {' | '.join(cells)} |")
            place = ""
    return "\n".join(lines)


def _order(structure: str) -> tuple[bool, str]:
    """Return the place of a structure: those that hear the payload first, by kind."""
    kinds = [*LOOKS, *STRUCTURES]
    return structure in HEARS_NO_PAYLOAD, f"{kinds.index(structure):02d}"


def figure(rows: Rows, kind: str = "svg") -> bytes:
    """Return payload rms over the delay, a panel for each rope, as a picture."""
    from stillhook.text import REFERENCE, new_figure, picture, styled

    with styled():
        sheet = new_figure(9.6, 6.0)
        panels = sheet.subplots(2, 3, sharey=True).ravel()
        for axes, rope in zip(panels, ROPES, strict=False):
            for structure, (colour, mark) in LOOKS.items():
                own = [r for r in rows.values() if (r.rope, r.structure) == (rope, structure)]
                own = sorted((r for r in own if r.ok), key=lambda r: r.delay)
                near = [r for r in own if r.link == "given"]
                x = np.array([1e3 * r.delay for r in near])
                y = np.array([1e3 * r.payload_rms for r in near])
                axes.plot(x, y, mark + "-", color=colour, ms=4.5, lw=1.2, label=structure)
                # The acoustic link lies far out on this axis: beside it, at the same height.
                far = [1e3 * r.payload_rms for r in own if r.link == "acoustic"]
                axes.plot([118.0] * len(far), far, mark, color=colour, ms=4.5, mfc="none")
            forward = [r for r in rows.values() if (r.rope, r.structure) == (rope, "feed-forward")]
            for row in forward:
                axes.axhline(
                    1e3 * row.payload_rms, color=REFERENCE, lw=1.0, ls="--", label="feed-forward"
                )
                axes.axhline(1e3 * row.hook_rms, color="#999999", lw=1.0, ls=":", label="hook")
            axes.set_yscale("log")
            axes.set_xticks(
                [0, 25, 50, 100, *([118] if rope != "one spring" else [])],
                ["0", "25", "50", "100", *(["ac."] if rope != "one spring" else [])],
            )
            axes.set_title(rope if rope == "one spring" else f"{rope} m of rope", fontsize=10.0)
        for axes in panels[len(ROPES) :]:
            axes.axis("off")
            axes.legend(*panels[0].get_legend_handles_labels(), loc="center", frameon=False)
        sheet.supxlabel("telemetry delay [ms]; ac.: acoustic, 67 ms to 1.3 s", fontsize=10.0)
        sheet.supylabel("payload [mm rms]", fontsize=10.0)
    return picture(sheet, kind)


def write_into(page: Path, text: str) -> None:
    """Replace what stands between the marks of a page."""
    old = page.read_text(encoding="utf-8")
    if old.count(BEGIN) != 1 or old.count(END) != 1:
        raise ValueError(f"{page} must hold {BEGIN} and {END} once each")
    before, rest = old.split(BEGIN)
    after = rest.split(END)[1]
    page.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> None:
    """Write table and figure."""
    docs = docs_folder(study_parser(__doc__).parse_args(argv).quick)
    rows = read(CSV)
    if docs == PAGE.parent:
        write_into(PAGE, table(rows))
    else:
        (docs / PAGE.name).write_text(table(rows), encoding="utf-8")
    (docs / "images" / FIGURE.name).write_bytes(figure(rows))


if __name__ == "__main__":
    main()
