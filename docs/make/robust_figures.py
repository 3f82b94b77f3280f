"""Figures of what robust design buys, from `docs/data`: `python docs/make/robust_figures.py`.

`pareto.svg`: payload motion against torque, M_s and delay margin.  `robust.svg`: each scenario of a
family with one set of gains for the worst and for the mean.  `structure_bounds.svg`: each structure
on the subsea crane beside the least that any linear controller leaves with the same sensors.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from stored import DOCS, docs_folder, read_rows, study_parser

ROOT = Path(__file__).resolve().parents[2]
DATA, IMAGES = ROOT / "docs" / "data", ROOT / "docs" / "images"
LABELS = {
    "torque": "torque [kN m rms]",
    "max_sensitivity": "M_s [-]",
    "delay_margin": "delay margin [s]",
}
SCALES = {"torque": 1e-3}


def read(name: str, docs: Path = DOCS) -> list[dict[str, str]]:
    """Return the rows of a data file."""
    return read_rows(docs / "data" / name)


def pareto(kind: str = "svg", docs: Path = DOCS) -> bytes:
    """Return the fronts as a picture."""
    from stillhook.text import AFTER, BEFORE, new_figure, picture, styled, typeset

    rows = read("pareto.csv", docs)
    names = list(dict.fromkeys(row["against"] for row in rows))
    with styled():
        sheet = new_figure(9.2, 3.6)
        for axes, name in zip(sheet.subplots(1, len(names), sharey=True), names, strict=True):
            own = [row for row in rows if row["against"] == name]
            scale = SCALES.get(name, 1.0)
            x = np.array([float(row["bound"]) * scale for row in own])
            y = np.array([1e3 * float(row["payload_rms"]) for row in own])
            axes.plot(x, y, ".-", color=AFTER, ms=3.0, lw=1.0)
            knee = [row["knee"] == "yes" for row in own]
            axes.plot(x[knee], y[knee], "o", color=BEFORE, ms=7.0, mfc="none", mew=1.6)
            axes.set_yscale("log")
            axes.set_xlabel(typeset(LABELS[name]))
        sheet.axes[0].set_ylabel("payload [mm rms]")
        sheet.suptitle(
            "What stillness costs on the 1975 winch, one spring; circle: knee",
            x=0.012,
            ha="left",
            fontsize=11.0,
        )
    return picture(sheet, kind)


def robust(kind: str = "svg", docs: Path = DOCS) -> bytes:
    """Return each scenario with the drum held, with gains for all and with gains of its own."""
    from stillhook.text import AFTER, BEFORE, REFERENCE, new_figure, picture, styled

    rows = read("robust.csv", docs)
    by_objective = {
        name: {row["scenario"]: row for row in rows if row["objective"] == name}
        for name in ("worst", "mean", "regret")
    }
    shared = set.intersection(*(set(found) for found in by_objective.values()))
    order = sorted(shared, key=lambda name: float(by_objective["worst"][name]["payload_rms"]))

    def column(objective: str, key: str) -> list[float]:
        return [1e3 * float(by_objective[objective][name][key]) for name in order]

    x = np.arange(1, len(order) + 1)
    with styled():
        sheet = new_figure(8.4, 4.4)
        axes = sheet.subplots()
        axes.plot(x, column("worst", "payload_rms_before"), "x", color=BEFORE, label="drum held")
        largest = max(column("worst", "payload_rms"))
        label = f"one set of gains for the worst: at most {largest:.0f} mm"
        axes.plot(x, column("worst", "payload_rms"), "o", color=AFTER, ms=5.0, label=label)
        largest = max(column("mean", "payload_rms"))
        label = f"one set for the mean: at most {largest:.0f} mm"
        look = {"ms": 9.0, "mfc": "none", "mew": 1.2}
        axes.plot(x, column("mean", "payload_rms"), "s", color=REFERENCE, label=label, **look)
        axes.plot(
            x,
            column("regret", "best_rms"),
            "_",
            color=AFTER,
            ms=9.0,
            mew=2.0,
            label="gains of its own",
        )
        axes.set_yscale("log")
        axes.set(xlabel="scenario, by motion with one set of gains", ylabel="payload [mm rms]")
        axes.set_title(
            f"{len(order)} plants and seas of the 1975 winch under one set of gains", fontsize=11.0
        )
        sheet.legend(loc="outside lower center", ncols=2)
    return picture(sheet, kind)


def structure_bounds(kind: str = "svg", docs: Path = DOCS) -> bytes:
    """Return the structures beside their bounds as a picture."""
    from stillhook.text import AFTER, REFERENCE, new_figure, picture, styled

    rows = sorted(
        read("structure_bounds.csv", docs), key=lambda r: float(r["on_the_bound_s_terms"])
    )
    with styled():
        sheet = new_figure(8.4, 4.2)
        axes = sheet.subplots()
        for k, row in enumerate(rows):
            design = 1e3 * float(row["on_the_bound_s_terms"])
            own, every = (
                1e3 * float(row[key]) for key in ("bound_same_sensors", "bound_all_sensors")
            )
            axes.plot([own, design], [k, k], color="#bbbbbb", lw=2.0, zorder=1)
            axes.plot(design, k, "o", color=AFTER, ms=7.0, label="design" if k == 0 else None)
            label = "bound, same sensors" if k == 0 else None
            axes.plot(own, k, "|", color=REFERENCE, ms=14.0, mew=2.2, label=label)
            label = "bound, all sensors" if k == 0 else None
            axes.plot(every, k, "|", color=REFERENCE, ms=14.0, mew=1.0, alpha=0.5, label=label)
        axes.set_xscale("log")
        axes.set_yticks(range(len(rows)), [row["structure"] for row in rows])
        axes.invert_yaxis()
        axes.set_xlabel("payload [mm rms]")
        axes.set_title("subsea-crane: designs and what no linear controller beats", fontsize=11.0)
        sheet.legend(loc="outside lower center", ncols=3)
    return picture(sheet, kind)


def write(docs: Path, kind: str = "svg") -> None:
    """Write the figures whose data are there."""
    for make in (pareto, robust, structure_bounds):
        if (docs / "data" / f"{make.__name__}.csv").exists():
            (docs / "images" / f"{make.__name__}.{kind}").write_bytes(make(kind, docs))


if __name__ == "__main__":
    write(docs_folder(study_parser(__doc__).parse_args().quick))
