"""What the figures of sweeps have in common: numbers, names, units, which cases are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray

from ..text import scale, typeset

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


OWN = ("case", "seed")  # coordinates that are not varied
_PLAIN = ("mass", "length", "coefficient", "radius", "inertia", "ratio", "efficiency", "bandwidth")


def stable_of(result: xr.Dataset) -> npt.NDArray[np.bool_]:
    """Return which cases are stable, (n,)."""
    return np.asarray(result["stable"].to_numpy() == 1)


def numbers_in(result: xr.Dataset, name: str) -> FloatArray:
    """Return a variable or coordinate as numbers, (n,)."""
    return np.asarray(result[name].to_numpy(), dtype=np.float64)


def thinned(count: int, most: int) -> npt.NDArray[np.intp]:
    """Return indices spread evenly over what there is: a Sobol sequence stays one."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def shown(stable: npt.NDArray[np.bool_], most: int) -> npt.NDArray[np.intp]:
    """Return the cases that are shown, in their order: a share of both kinds, if rare all."""
    bad, good = np.flatnonzero(~stable), np.flatnonzero(stable)
    rare = min(bad.size, max(most // 10, int(most * bad.size / stable.size)))
    kept = [good[thinned(good.size, most - rare)] if good.size else good]
    kept.append(bad[thinned(bad.size, rare)] if rare else bad[:0])
    return np.sort(np.concatenate(kept))


def unit_of(result: xr.Dataset, name: str, typical: float) -> tuple[float, str]:
    """Return what to divide a variable by, and the unit it is then in."""
    unit = str(result[name].attrs.get("units", "1"))
    return (1.0, "") if unit in ("1", "") else scale(unit, typical)


def words_of(name: str) -> str:
    """Return a name as one says it."""
    if name == "max_sensitivity":
        return "M_s"
    if name.startswith("gains."):
        return f"gain {name.removeprefix('gains.')}"
    *sections, short = name.split(".")
    if short in _PLAIN and sections:
        short = f"{sections[-1]} {short}"
    return short.replace("_", " ")


def title(figure: Figure, axes: Axes, result: xr.Dataset, finding: str) -> None:
    """Write what the figure found, and below it what varied."""
    figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, fontweight="bold")
    paths = [words_of(str(n)) for n in result.coords if str(n) not in OWN]
    told = ", ".join(paths[:6]) + (", .." if len(paths) > 6 else "")
    about = f"varying {told}"
    axes.set_title(about, fontsize=9.0, fontweight="normal", color="#555555", pad=6.0)
