"""An FMU loaded and driven through FMPy: what proves it, and what its tests use."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Self

import numpy as np

from models.basics import FloatArray, SolverError

from .package import Fmu


class Slave:
    """One instance of an FMU, initialised; a context manager that frees it."""

    def __init__(
        self,
        fmu: Fmu,
        *,
        start: Mapping[str, float] | None = None,
        at: float = 0.0,
        guid: str | None = None,
    ) -> None:
        """Load an FMU with inputs that are set before it begins, by name.

        Raises SolverError if it refuses to be instantiated.
        """
        fmpy, fmi2 = import_module("fmpy"), import_module("fmpy.fmi2")
        self._folder = Path(tempfile.mkdtemp(prefix="stillhook-"))
        packed = self._folder / f"{fmu.name}.fmu"
        packed.write_bytes(fmu.content)
        fmpy.extract(str(packed), str(self._folder / "fmu"))
        told = fmpy.read_model_description(str(self._folder / "fmu"))
        self.reference = {v.name: v.valueReference for v in told.modelVariables}
        self.made: Any = fmi2.FMU2Slave(
            guid=told.guid if guid is None else guid,
            unzipDirectory=str(self._folder / "fmu"),
            modelIdentifier=told.coSimulation.modelIdentifier,
            instanceName=fmu.name,
        )
        try:
            self.made.instantiate()
        except Exception as error:  # FMPy says no more than that
            self.made.freeLibrary()
            shutil.rmtree(self._folder, ignore_errors=True)
            raise SolverError(f"export: fmu: {fmu.name} cannot be instantiated") from error
        self.begin(start, at=at)

    def begin(self, start: Mapping[str, float] | None = None, *, at: float = 0.0) -> None:
        """Initialise it, with inputs by name, to start at a time [s]."""
        self.made.setupExperiment(startTime=at)
        self.made.enterInitializationMode()
        if start:
            self.set(start)
        self.made.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        """Set real inputs by name."""
        self.made.setReal([self.reference[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        """Return real variables by name."""
        found: list[float] = self.made.getReal([self.reference[name] for name in names])
        return found

    def step(self, at: float, step: float) -> None:
        """Go on from a time over a communication step [s]."""
        self.made.doStep(currentCommunicationPoint=at, communicationStepSize=step)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ignored: object) -> None:
        self.made.terminate()
        self.made.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


def check_valid(fmu: Fmu) -> None:
    """Check an FMU by FMPy's validation.

    Raises SolverError if that finds a problem.
    """
    with tempfile.TemporaryDirectory(prefix="stillhook-") as folder:
        packed = Path(folder) / f"{fmu.name}.fmu"
        packed.write_bytes(fmu.content)
        problems = import_module("fmpy.validation").validate_fmu(str(packed))
    if problems:
        raise SolverError(f"export: fmu: {fmu.name} is not valid: {'; '.join(problems)[:300]}")


def replayed(
    fmu: Fmu, inputs: Sequence[str], rows: FloatArray, period: float, command: str, status: str
) -> tuple[FloatArray, FloatArray]:
    """Return what an FMU commands and says of each step (n,), of rows of its inputs.

    Rows are (n, len(inputs)), one in every period [s]; command and status are outputs by name.
    """
    commands, statuses = np.empty(len(rows)), np.empty(len(rows))
    with Slave(fmu) as slave:
        given = [slave.reference[name] for name in inputs]
        asked, said = [slave.reference[command]], [slave.reference[status]]
        for k, row in enumerate(rows.tolist()):
            slave.made.setReal(given, row)
            slave.step(k * period, period)
            commands[k] = slave.made.getReal(asked)[0]
            statuses[k] = slave.made.getInteger(said)[0]
    return commands, statuses
