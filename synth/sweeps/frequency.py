"""Sweeps in the frequency domain: thousands to millions of cases around one design.

    frequency_sweep(design, spread, samples=..) -> xarray.Dataset along "case"
    FrequencyEngine(design, spread).evaluate(rows) -> columns, for whoever brings rows
    FrequencyEngine(design, spread).chunks(samples=..) -> dataset after dataset

The last is for more cases than memory holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from models.basics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    InputError,
    Quadrature,
    check_range,
    one_thread,
)
from models.case import Case
from models.operation import PREFIX as FAULTS
from models.spread import Spread

from ..design import Design
from ..search import Progress
from .dataset import dataset_of
from .design_rows import ACCURACY, DesignRows
from .metrics import chosen_metrics, finished

if TYPE_CHECKING:
    import xarray as xr

_CHUNK = 65_536


class FrequencyEngine:
    """A design, asked about rows of numbers: what all sweeps in the frequency domain go through.

    Parameters
    ----------
    design
        A design of any structure.  Its controller stays what it is, whatever the case becomes.
    spread
        What varies.
    metrics
        Names of `synth.sweeps.metrics.METRICS`; `stable` always comes along.
    accuracy
        Relative difference of a variance by two rules from which it gets finer nodes; what is
        then left of the error is some two digits less.
    nodes
        Nodes for all integrals, with no look at their error.

    Raises
    ------
    InputError
        If the design or the spread does not suit.
    """

    def __init__(
        self,
        design: Design,
        spread: Spread,
        *,
        metrics: Sequence[str] | None = None,
        accuracy: float = ACCURACY,
        nodes: Quadrature | None = None,
    ) -> None:
        check_range("sweep", "accuracy", accuracy, low=0.0, high=1.0, open_low=True)
        self.design = design
        if not isinstance(design, Design):
            raise InputError(
                "sweep: in the frequency domain the design must be a Design, got "
                f"{type(design).__name__}"
            )
        case = design.sea_case
        late = [path for path in spread.paths if path.startswith(FAULTS)]
        if late:
            raise InputError(f"sweep: {late[0]} happens in time; use mode 'time'")
        if "rope.masses" in spread.paths:
            raise InputError("sweep: rope.masses cannot vary; a design has one number of masses")
        self.case: Case = case
        self.spread = spread.on(case, design.parameters, design.drag)
        self.metrics = chosen_metrics(metrics, dc=case.winch.motor.type == "dc")
        if not design.parameters:
            raise InputError(f"sweep: the design has no controller: {design.status}")
        self.rows = DesignRows(
            design.question,
            design.parameters,
            self.spread,
            outputs=[m.output for m in self.metrics if m.output],
            second=[m.output for m in self.metrics if m.kind in ("peak", "least", "period")],
            peaks=any(m.name == "max_sensitivity" for m in self.metrics),
            start=design.drag,
            accuracy=accuracy,
            nodes=nodes,
        )

    def evaluate(
        self, rows: FloatArray, progress: Progress | None = None
    ) -> dict[str, FloatArray | BoolArray]:
        """Return ``stable`` and the metrics of rows, (n,) each; NaN where a loop is unstable.

        A row's numbers do not depend on the rows beside it, but for the last digits.  Their values
        are SI, (n, d), in the order of `spread.paths`.

        Raises InputError if rows do not fit the spread, or a value is out of its range.
        """
        # Column by column, as they are read.
        table = np.asarray(np.atleast_2d(rows), dtype=np.float64, order="F")
        if table.shape[1] != len(self.spread.paths):
            raise InputError(
                f"sweep: rows must have {len(self.spread.paths)} columns, got {table.shape[1]}"
            )
        for field, column in zip(self.spread.fields, table.T, strict=True):
            for value in (column.min(), column.max()) if len(table) else ():
                check_range("sweep", field.path, value, low=field.low, high=field.high)
        found: dict[str, Any] = {
            "stable": np.zeros(len(table), dtype=bool),
            **{m.name: np.full(len(table), np.nan) for m in self.metrics},
        }
        for at in range(0, len(table), self.rows.block):
            part = slice(at, min(at + self.rows.block, len(table)))
            solved = self.rows.solve(table[part])
            found["stable"][part] = solved.stable
            columns = finished(self.metrics, solved, self.case.limits.equivalent_exposure)
            for name, column in columns.items():
                found[name][part] = column
            if progress is not None:
                progress("cases", part.stop, len(table))
        return found

    def loop_gain(self, rows: FloatArray, omega: FloatArray) -> ComplexArray:
        """Return the loop gain L(i omega) of rows, (n, k), at frequencies above zero [rad/s]."""
        return self.rows.loop_gain(np.atleast_2d(rows), np.asarray(omega, dtype=np.float64))

    def chunks(
        self,
        *,
        samples: int | None,
        sampling: str = "sobol",
        seed: int = 0,
        chunk: int | None = None,
        start: int = 0,
        progress: Progress | None = None,
    ) -> Iterator[xr.Dataset]:
        """Yield the datasets of one chunk of cases after the other, from case `start` on.

        Nothing but the chunk at hand is kept, so that the number of cases has no bound but time.
        Parameters are those of `frequency_sweep`.

        Raises InputError if the samples or a case are not valid.
        """
        size = int(check_range("sweep", "chunk", chunk or _CHUNK, low=1))
        total = self.spread.count(samples, sampling)
        notes = {"sampling": sampling, "seed": seed, "samples": total}
        for at in range(start, total, size):
            stop = min(at + size, total)
            rows = self.spread.sample(samples, sampling, seed, start=at, stop=stop)

            def tell(stage: str, done: int, _: int, before: int = at) -> None:
                if progress is not None:
                    progress(stage, before + done, total)

            columns = self.evaluate(rows, tell)
            own = {
                "nodes": len(self.rows.level_nodes()),
                "refined": self.rows.refined,
                "unresolved": self.rows.unresolved,
            }
            yield dataset_of(
                self.design,
                self.spread,
                rows,
                columns,
                self.metrics,
                first=at,
                notes={**notes, **own},
            )


@one_thread()
def frequency_sweep(
    design: Design,
    spread: Spread,
    *,
    samples: int | None,
    sampling: str = "sobol",
    seed: int = 0,
    metrics: Sequence[str] | None = None,
    chunk: int | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Return what a spread does to a design: one case after the other along "case".

    The rope is damped as the case and the spread say.

    Parameters
    ----------
    design
        A design of any structure.
    spread
        What varies, see `models.spread.Spread`.
    samples
        Number of cases; None for ``corners`` and ``given``.
    sampling
        ``sobol``, ``lhs``, ``random``, ``grid``, ``corners`` or ``given``.
    seed
        Of the samples: case i depends on (seed, i) only.
    metrics
        Names of `synth.sweeps.metrics.METRICS`; by default rms of payload, torque and speed, and
        M_s.
    chunk
        Cases at once; memory beyond the dataset's own is that of a chunk.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    xarray.Dataset
        Dimension "case"; a coordinate for every path; `stable` and the metrics, NaN where the
        loop is unstable; the question in the attributes.

    Raises
    ------
    InputError
        If the design, the spread or a case is not valid.
    """
    import xarray as xr

    engine = FrequencyEngine(design, spread, metrics=metrics)
    parts = list(
        engine.chunks(samples=samples, sampling=sampling, seed=seed, chunk=chunk, progress=progress)
    )
    if len(parts) == 1:
        return parts[0]
    # The counts of the last chunk are those of all.
    whole = xr.concat(parts, dim="case", combine_attrs="override")
    return whole.assign_attrs(parts[-1].attrs)
