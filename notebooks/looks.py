"""What the notebooks share of looks: colours, the shape of a figure, tables, prose with numbers.

Import it first; the figures that follow then look alike.  The colours are those of the toolkit's
own figures (Okabe and Ito, 2008): readers who see few colours can tell them apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
from IPython.display import Markdown

BEFORE = "#d55e00"  # with the drum held, or what is left behind
AFTER = "#0072b2"  # with the design that is looked at
DRUM = "#009e73"
HOOK = "#8c8c8c"
REFERENCE = "#1a1a1a"
OTHERS = ("#cc79a7", "#e69f00", "#56b4e9")

plt.rcParams.update(
    {"figure.figsize": (8.0, 3.6), "figure.constrained_layout.use": True, "axes.grid": True}
    | {"grid.color": "#d9d9d9", "axes.spines.top": False, "axes.spines.right": False}
)


def table(
    head: Sequence[str], rows: Sequence[Sequence[object]], *, digits: int = 4, words: int = 1
) -> Markdown:
    """Return a table of numbers and texts, its first columns of words set to the left.

    Parameters
    ----------
    head
        What the columns are, with units.
    rows
        One entry for each column; a number is shown with so many significant digits.
    digits
        Significant digits of a number.
    words
        How many columns are of words.
    """
    cells = [[v if isinstance(v, str) else f"{v:.{digits}g}" for v in row] for row in rows]
    rule = ["---"] * words + ["---:"] * (len(head) - words)
    lines = [" | ".join(cell.replace("|", r"\|") for cell in line) for line in (head, rule, *cells)]
    return Markdown("\n".join(f"| {line} |" for line in lines))


def say(text: str) -> Markdown:
    """Return prose whose numbers were computed, as an f-string is."""
    return Markdown(text)
