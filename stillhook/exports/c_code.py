"""A law as C99: sources without allocation, and a program that replays the recording.

Law --> NAME.h, NAME*.c --> main.c + vector.csv --> compiled, run, compared
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from models.basics import SolverError
from models.sensing import NativeLaw
from models.simulation import Compiler, compile_into, find_compiler

from .exported import Exported
from .facts import facts_of
from .law import Law
from .recording import Recording
from .signals import SIGNALS, STATUS_TEXTS

VECTOR = "vector.csv"
#: What a compiler is told, so that the numbers are those of the simulation to the last bit.
EXACT = ("-std=c99", "-O2", "-ffp-contract=off")
#: Of the command's range: what a compiler that is told otherwise may change.
TOLERANCE = 1e-12
#: The same of predictive control, whose solver ends where the optimality conditions hold that well.
PREDICTIVE = 1e-6
_LIMIT = 300.0  # of replaying [s]
_WIDTH = 78

_MAIN = r"""/* Replays the recording and compares: ./{prefix} [FILE, by default vector.csv] */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "{prefix}.h"

#define LINE 4096

/* What the program keeps between two samples; a drive has it where it likes. */
static {prefix}_memory memory;

{same}

int main(int count, char **words) {{
  const char *path = count > 1 ? words[1] : "vector.csv";
  const double range = {range}, allowed = {allowed};
  double worst = 0.0;
  long rows = 0, worst_row = 0, other_status = 0;
  char line[LINE];
  FILE *file = fopen(path, "r");
  if (!file || !fgets(line, LINE, file)) {{
    fprintf(stderr, "%s: cannot be read\n", path);
    return 2;
  }}
  {prefix}_reset(&memory);
  while (fgets(line, LINE, file)) {{
    double numbers[{columns}];
    char *at = line, *end;
    int i;
    for (i = 0; i < {columns}; i++) {{
      numbers[i] = strtod(at, &end);
      if (end == at) {{
        fprintf(stderr, "%s: row %ld has no number in column %d\n", path, rows + 2, i + 1);
        return 2;
      }}
      at = *end == ',' ? end + 1 : end;
    }}
    {{
      double command = {prefix}_step(&memory, numbers + 1);
      double off = fabs(command - numbers[{columns} - 2]) / range;
      if (!(off <= worst)) {{
        worst = off;
        worst_row = rows;
      }}
      other_status += same({prefix}_status(&memory)) != same((int)numbers[{columns} - 1]);
    }}
    rows++;
  }}
  fclose(file);
  printf("samples %ld\nlargest difference %.17g of the command's range, at sample %ld\n"
         "statuses that differ %ld\n", rows, worst, worst_row, other_status);
  return rows > 0 && worst <= allowed && other_status == 0 ? 0 : 1;
}}
"""

_EACH = "static int same(int status) { return status; }"
_ALIKE = """\
/* Whether the drive follows the whole command shows in the last digits of a command that is small;
   the record holds those of another computation. */
static int same(int status) { return status <= 1 ? 0 : status; }"""

_MAKEFILE = """\
# make        builds the program that replays vector.csv
# make check  builds and runs it
# The flags keep every number as in the simulation; with others it differs in the last digits.
CC ?= cc
CFLAGS ?= {flags}

{prefix}: main.c {sources} {prefix}.h
\t$(CC) $(CFLAGS) -o $@ main.c {sources}{links} -lm

check: {prefix}
\t./{prefix} {vector}

.PHONY: check
"""

_ABOUT = """\
## What it is

`{prefix}.h` declares three functions; the sources beside it allocate nothing, call nothing but
`math.h` and `string.h`{solver}, and keep all their numbers in one `{prefix}_memory`, which may lie
anywhere and be copied as bytes.

```c
static {prefix}_memory memory;
{prefix}_reset(&memory);                      /* once */
double command = {prefix}_step(&memory, measured);   /* every {period}: the command [{unit}] */
int status = {prefix}_status(&memory);        /* of that step, see below */
```

`measured` holds the numbers of the table of signals in its order.

## How it is built, and the test

    make check

builds the sources with `{flags}` and replays `vector.csv`: it prints the largest difference between
the commands and those of the simulation, and ends with status 0 if it is at most
{allowed:g} of the command's range.  Without `-ffp-contract=off`, or with `-ffast-math`, a compiler
may change the last digits.{library}
"""


def as_c(law: Law, recording: Recording) -> Exported:
    """Return the C of a law, compiled and replayed if there is a compiler.

    Raises SolverError if the compiler fails, or the replay finds other commands.
    """
    native, prefix = law.native, law.name
    predictive = law.recursion is None
    allowed = PREDICTIVE if predictive else TOLERANCE
    columns = len(SIGNALS) + 3
    fields: dict[str, object] = {"prefix": prefix, "columns": columns, "range": repr(law.span)}
    fields |= {"allowed": allowed, "same": _ALIKE if predictive else _EACH}
    files: dict[str, str | bytes] = dict(native.files)
    files[f"{prefix}.h"] = (
        f"{_comment(law)}\n{_enumerations(prefix)}\n{native.files[f'{prefix}.h']}"
    )
    files |= {"main.c": _MAIN.format(**fields), VECTOR: recording.csv()}
    files["Makefile"] = _MAKEFILE.format(
        prefix=prefix,
        sources=" ".join(native.sources),
        links="".join(f" {name}" for name in native.links),
        flags=" ".join(EXACT),
        vector=VECTOR,
    )
    files |= {name: path.read_bytes() for name, path in native.copied.items()}
    compiler = find_compiler()
    if compiler is None:
        proof = "It was not compiled: there is no C compiler on the machine that wrote it."
    else:
        proof = replayed(native, files, compiler)
    return Exported(
        kind="c",
        title="C99",
        files=files,
        about=_ABOUT.format(
            prefix=prefix,
            period=f"{1e3 * law.sample_time:g} ms",
            unit=law.unit,
            flags=" ".join(EXACT),
            allowed=allowed,
            solver=", and the solver in `daqp`" if predictive else "",
            library=_LIBRARY if native.links else "",
        ),
        proof=proof,
        proved=compiler is not None,
    )


_LIBRARY = """

`daqp` holds the solver of the quadratic programme, DAQP (MIT, its licence beside it), as it was
installed on the machine that wrote this: a library for that processor and system.  For another one
build it there from the sources of the same version, https://github.com/darnstrom/daqp."""


def replayed(native: NativeLaw, files: Mapping[str, str | bytes], compiler: Compiler) -> str:
    """Compile what was exported in a folder of its own, replay the recording, and say what it said.

    Raises SolverError if it cannot be compiled, or finds other commands.
    """
    with tempfile.TemporaryDirectory(prefix="stillhook-") as name:
        folder = Path(name)
        words = [*EXACT, "main.c", *native.sources, *native.links, "-lm"]
        failure = "export: c: it cannot be compiled"
        program = compile_into(folder, files, words, "replay", compiler, failure=failure)
        said = _replay(program)
    count, worst, _ = said.splitlines()
    size = float(worst.split()[2])
    found = "the same commands to the last bit" if size == 0.0 else f"commands within {size:.2g}"
    more = "" if size == 0.0 else " of their range"
    return (
        f"Compiled with {compiler.version} and replayed over {count.split()[1]} samples: {found}"
        f"{more}, and the same statuses."
    )


def _replay(program: Path) -> str:
    """Return what a program says of the recording beside it.

    Raises SolverError if it finds other commands, or does not run.
    """
    failure = "export: c: the replay finds other commands"
    try:
        answer = subprocess.run(
            [str(program), VECTOR],
            cwd=program.parent,
            capture_output=True,
            text=True,
            timeout=_LIMIT,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise SolverError(f"{failure}: {error}") from error
    if answer.returncode != 0:
        said = " ".join((answer.stderr or answer.stdout).split())[:300]
        raise SolverError(f"{failure}: {said}")
    return answer.stdout


def _comment(law: Law) -> str:
    """Return the comment that the header begins with: what the law is, in figures."""
    lines = [f" * {name}: {value}"[: _WIDTH * 3] for name, value in facts_of(law)]
    head = (
        "/* A controller of an offshore winch, written by Stillhook.  It is no safety function.\n"
    )
    return head + " *\n" + "\n".join(lines) + "\n */"


def _enumerations(prefix: str) -> str:
    """Return what the indices of measurements and the numbers of statuses are called."""
    upper = prefix.upper()
    rows = [
        f"  {upper}_{signal.identifier.upper()} = {i}, /* [{signal.unit or 'command'}] "
        f"{signal.meaning} */"
        for i, signal in enumerate(SIGNALS)
    ]
    statuses = [
        f"  {upper}_IS_{name.upper()} = {i}, /* {text} */"
        for i, (name, text) in enumerate(STATUS_TEXTS)
    ]
    guard = f"{upper}_NAMES"
    lines = [f"#ifndef {guard}", f"#define {guard}"]
    lines += [f"enum {prefix}_signal {{", *rows, "};"]
    lines += [f"enum {prefix}_statuses {{", *statuses, "};", "#endif"]
    return "\n".join(lines)
