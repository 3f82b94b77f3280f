"""The style of all figures: one size, one grid, colours that everybody can tell apart.

The colours are those of Okabe and Ito (2008).  A colour means the same thing in every figure:
grey the hook, vermilion the payload with the drum held, blue the payload with the gains, green
what the winch does, black the reference.
"""

import contextlib
import logging
import re
from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, Literal, ParamSpec

from .fonts import FAMILY

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:
    Axes = Figure = Any  # matplotlib is loaded when something is drawn

P = ParamSpec("P")

HOOK = "#7f7f7f"
BEFORE = "#d55e00"
AFTER = "#0072b2"
DRUM = "#009e73"
REFERENCE = "#222222"
BROKEN = "#d55e00"
DASHED = (0, (4, 3))

_STYLE: Any = {
    "font.size": 10.0,
    "font.family": FAMILY,  # comes with matplotlib: the same everywhere
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.8,
    "savefig.facecolor": "white",
    # The same figure gives the same file: no random identifiers.
    "svg.hashsalt": "stillhook",
    "svg.fonttype": "none",  # words that can be selected and found, see `images`
}


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Apply the style to what is made inside, and leave matplotlib's settings as they were."""
    # On a fresh machine it announces that it looks for fonts; that is nobody's business.
    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)
    from matplotlib import rc_context

    with rc_context(_STYLE):
        yield


def new_figure(width: float = 7.2, height: float = 4.4) -> Figure:
    """Return an empty figure [inch] that belongs to nobody: no pyplot, no global state."""
    from matplotlib.figure import Figure as Figure

    return Figure(figsize=(width, height), layout="constrained")


def panel(width: float = 7.2, height: float = 4.4) -> tuple[Figure, Axes]:
    """Return an empty figure [inch] with one set of axes."""
    figure = new_figure(width, height)
    return figure, figure.add_subplot()


def drawn(make: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a function draw in the style of all figures."""

    @wraps(make)
    def inside(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with styled():
            return make(*args, **kwargs)

    return inside


def headline(figure: Figure, finding: str, about: str = "") -> Figure:
    """Set what a figure found as its title, and what it is about in small below; return it."""
    figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, fontweight="bold")
    if about:
        small: Any = {"fontsize": 9.5, "fontweight": "normal", "color": "#555555"}
        figure.axes[0].set_title(typeset(about), pad=6.0, **small)
    return figure


def logarithmic(
    axes: Axes, which: Literal["x", "y"] = "y", subs: Sequence[float] = (1.0, 2.0, 5.0)
) -> None:
    """Make an axis logarithmic, marked in plain numbers that begin with some digits."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    (axes.set_yscale if which == "y" else axes.set_xscale)("log")
    axis = axes.yaxis if which == "y" else axes.xaxis
    axis.set_major_locator(LogLocator(subs=subs, numticks=20))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def typeset(text: str) -> str:
    """Return a text with H_s, T_p, T_z, T_S and M_s as matplotlib's mathematics."""
    return re.sub(r"(?<!\$)\b(H_s|T_p|T_z|T_S|M_s)\b", r"$\1$", text)


def untypeset(text: str) -> str:
    """Return the words of a text in which some are set as matplotlib's mathematics.

    Examples
    --------
    >>> untypeset(typeset("H_s 2 m, M_s 1.8"))
    'H_s 2 m, M_s 1.8'
    """
    return text.replace("$", "")


def annotate(axes: Axes, text: str, at: tuple[float, float], offset: tuple[float, float]) -> None:
    """Write a remark near a point, joined to it by a thin line; `offset` in points."""
    axes.annotate(
        text,
        at,
        xytext=offset,
        textcoords="offset points",
        fontsize=9.0,
        color=REFERENCE,
        arrowprops={"arrowstyle": "-", "color": "#666666", "linewidth": 0.8},
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )
