"""The C of a controller, compiled and called, and controllers in Python whose C is known."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from models.sensing import (
    HEARD,
    STATUSES,
    Controller,
    ControllerAround,
    Measurement,
    NativeLaw,
    interface_header,
    recursion_as_c,
    recursion_of,
)
from models.simulation import find_compiler

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
FloatArray = npt.NDArray[np.float64]
EXACT = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-pedantic", "-Werror")


class Compiled:
    """A law in C with its memory, called one sample at a time."""

    def __init__(self, law: NativeLaw, *, flags: tuple[str, ...] = EXACT) -> None:
        compiler = find_compiler()
        assert compiler is not None
        law, size = law.written, f"{law.prefix}_bytes"
        files: dict[str, bytes] = {name: text.encode() for name, text in law.files.items()}
        files |= {name: path.read_bytes() for name, path in law.copied.items()}
        more = f'#include "{law.prefix}.h"\nlong {size}(void);\nlong {size}(void) {{\n'
        files["bytes.c"] = f"{more}  return (long)sizeof({law.prefix}_memory);\n}}\n".encode()
        # CasADi's own code has parameters that it does not use.
        command = [*compiler.command, *flags, "-Wno-unused-parameter", "-fPIC", "-shared"]
        command += ["-o", "law.so", *law.sources, "bytes.c", *law.links, "-lm"]
        # A library that is loaded does not need its file any more.
        with tempfile.TemporaryDirectory(prefix="stillhook-") as name:
            folder = Path(name)
            for path, content in files.items():
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / path).write_bytes(content)
            subprocess.run(command, cwd=folder, check=True)
            library = ctypes.CDLL(str(folder / "law.so"))
        self._reset, self._step, self._status = (
            getattr(library, f"{law.prefix}_{name}") for name in ("reset", "step", "status")
        )
        self._step.restype = ctypes.c_double
        bytes_of = getattr(library, size)
        bytes_of.restype = ctypes.c_long
        self.memory = np.zeros(bytes_of(), np.uint8)
        self.reset()

    @property
    def _at(self) -> ctypes.c_void_p:
        return ctypes.c_void_p(self.memory.ctypes.data)

    def reset(self) -> None:
        self._reset(self._at)

    def step(self, measured: FloatArray) -> float:
        given = np.ascontiguousarray(measured, dtype=np.float64)
        assert given.shape == (len(HEARD),)
        return float(self._step(self._at, ctypes.c_void_p(given.ctypes.data)))

    @property
    def status(self) -> str:
        return tuple(STATUSES)[self._status(self._at)]


class Spoken(ControllerAround):
    """A recursive law that is called from Python, and whose C is known."""

    recursion = None

    def as_c(self, prefix: str) -> NativeLaw:
        recursion = recursion_of(self._controller)
        assert recursion is not None
        return recursion_as_c(recursion, prefix)

    def step(self, measurement: Measurement, time: float) -> float:
        return self._controller.step(measurement, time)


class Counter:
    """A law with a status and a memory of its own, in Python and in C.

    It commands its static command and a little more each sample, says ``blind`` in every seventh,
    has no number in every 211th, and what went to the drive instead of its command counts.
    """

    name = "counter"

    def __init__(self, static: float, sample_time: float = 0.01) -> None:
        self._static, self.sample_time = static, sample_time
        self.reset()

    def reset(self) -> None:
        self._count, self._told = 0, 0.0

    def commanded(self, command: float) -> None:
        self._told = command

    def step(self, measurement: Measurement, time: float) -> float:
        self._count += 1
        if self._count % 211 == 0:
            return float("nan")
        haul = measurement["drum.haul"]
        lost = 0.25 if np.isnan(haul) or np.isnan(measurement["rope.tension"]) else 0.0
        set_point = measurement["reference.displacement"]
        return self._static + 0.01 * self._count + 1e-3 * self._told + lost + 0.1 * set_point

    @property
    def status(self) -> str:
        return "blind" if self._count % 7 == 0 else "engaged"

    def as_c(self, prefix: str) -> NativeLaw:
        at = {name: i for i, name in enumerate(HEARD)}
        memory = f"typedef struct {{\n  long count;\n  double told;\n}} {prefix}_memory;"
        source = f"""\
#include <math.h>
#include "{prefix}.h"
void {prefix}_reset({prefix}_memory *memory) {{
  memory->count = 0;
  memory->told = 0.0;
}}
void {prefix}_commanded({prefix}_memory *memory, double command) {{ memory->told = command; }}
double {prefix}_step({prefix}_memory *memory, const double *measured) {{
  double lost = 0.0;
  memory->count++;
  if (memory->count % 211 == 0) return NAN;
  if (isnan(measured[{at["drum.haul"]}]) || isnan(measured[{at["rope.tension"]}])) lost = 0.25;
  return {self._static!r} + 0.01 * (double)memory->count + 1e-3 * memory->told + lost
    + 0.1 * measured[{at["reference.displacement"]}];
}}
int {prefix}_status(const {prefix}_memory *memory) {{
  return memory->count % 7 == 0 ? {tuple(STATUSES).index("blind")} : 0;
}}
"""
        header = interface_header(prefix, memory, commanded=True)
        files = {f"{prefix}.h": header, f"{prefix}.c": source}
        return NativeLaw(prefix=prefix, files=files, commanded=True)


def measurements(rest: Measurement, count: int, seed: int = 0) -> FloatArray:
    """Return rows of measurements, (n, 21), in which each signal is lost and back."""
    rng = np.random.default_rng(seed)
    at = {name: i for i, name in enumerate(HEARD)}
    rows = np.tile(rest.values, (count, 1))
    rows += 0.05 * rng.standard_normal(rows.shape) * (1.0 + np.abs(rest.values))
    for name in ("payload.valid", "mru.valid", "operator.enable", "encoder.valid"):
        rows[:, at[name]] = 1.0
    rows[:, at["load_cell.valid"]] = 1.0
    rows[:, at["operator.reset"]] = 0.0
    rows[:, at["payload.age"]] = np.abs(rows[:, at["payload.age"]])
    for share, name, value in (
        (0.1, "payload.valid", 0.0),
        (0.2, "mru.valid", 0.0),
        (0.3, "load_cell.valid", 0.0),
        (0.4, "operator.enable", 0.0),
        (0.5, "payload.displacement", np.nan),
        (0.6, "encoder.valid", 0.0),
        (0.75, "payload.age", 30.0),
    ):
        start = round(share * count)
        rows[start : start + count // 20, at[name]] = value
    rows[round(0.7 * count), at["operator.reset"]] = 1.0
    rows[round(0.8 * count) :, at["reference.displacement"]] = 0.4
    return rows


def played(controller: Controller, rows: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return commands and statuses of a controller in Python."""
    controller.reset()
    commands, statuses = np.empty(len(rows)), []
    for k, row in enumerate(rows):
        commands[k] = controller.step(Measurement(row), k * controller.sample_time)
        statuses.append(str(getattr(controller, "status", "engaged")))
    return commands, statuses
