"""What the command line shows of itself: help texts, exit codes, names of the files it writes.

They are frozen while files move, and renewed as a whole when the command line is rebuilt: this
module and `faces.json` can leave together.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from stillhook.cli import main
from stillhook.text.folder import LIST

HERE = Path(__file__).parent

COMMANDS = (
    *("optimise", "structures", "evaluate", "robust", "margins", "sensitivity", "operability"),
    *("pareto", "size", "worth", "simulate", "compare", "sweep", "scenarios", "bound", "sea"),
    *("motion", "vessel", "check", "cases", "new", "schema"),
)

#: Calls whose exit code alone is kept; CASES is the folder of the frozen cases.
CALLS = (
    "",
    "--version",
    "cases",
    "scenarios",
    "scenarios landing",
    "scenarios nonsense",
    "schema",
    "nonsense",
    "check CASES/thesis-1975.yaml",
    "check CASES/missing.yaml",
    "check CASES/thesis-1975.yaml --set sea.significant_height=-1",
    "check CASES/thesis-1975.yaml --set no.such.field=1",
    "check subsea-crane",
    "evaluate CASES/thesis-1975.yaml --no-bound --quiet",
    "evaluate CASES/thesis-1975.yaml --no-bound --quiet --set limits.max_sensitivity=6",
    "evaluate CASES/thesis-1975.yaml --gains A=-200,a=50,a1=100,a2=100 --no-bound --quiet",
    "evaluate CASES/thesis-1975.yaml --gains A=x",
    "margins CASES/thesis-1975.yaml --draws 10 --quiet",
    "margins CASES/thesis-1975.yaml --off payload.mass=2",
    "optimise CASES/thesis-1975.yaml --structure nonsense",
    "optimise",
    "robust CASES/thesis-1975.yaml --vary payload.mass",
    "pareto CASES/thesis-1975.yaml --against luck",
    "size CASES/thesis-1975.yaml --target much",
    "simulate CASES/thesis-1975.yaml --controller nonsense",
    "compare CASES/thesis-1975.yaml --list",
    "compare CASES/thesis-1975.yaml --controllers nonsense",
    "sweep CASES/thesis-1975.yaml --vary nonsense=1",
    "sweep",
    "operability CASES/thesis-1975.yaml --tp 5..x",
    "sea CASES/missing.txt",
    "vessel list",
    "vessel import missing.csv",
    "bound CASES/thesis-1975.yaml --sensors nonsense",
    "bound CASES/thesis-1975.yaml --quiet",
)

_UNIT = "--set 'sensors.mru={noise_floor: 0, noise_fraction: 0}'"

#: Calls whose files are kept as well; OUT is an empty folder.
WRITERS = (
    "new OUT/mine.yaml",
    "schema OUT/schema.json",
    "evaluate CASES/thesis-1975.yaml --no-bound --quiet --out OUT",
    "optimise CASES/thesis-1975.yaml --starts 1 --no-bound --quiet --out OUT",
    f"optimise CASES/thesis-1975.yaml {_UNIT} --structure feed-forward --starts 1 --no-bound "
    "--quiet --out OUT",
    f"structures CASES/thesis-1975.yaml {_UNIT} --structures payload-feedback,feed-forward "
    "--starts 1 --no-bound --quiet --out OUT",
    "sensitivity CASES/thesis-1975.yaml --second 0 --quiet --out OUT",
    "sensitivity CASES/thesis-1975.yaml --second 0 --vary payload.mass=5% "
    "--vary rope.axial_stiffness=5% --samples 32 --quiet --out OUT",
    "operability CASES/thesis-1975.yaml --tp 7,11 --payload-rms '50 mm' --quiet --out OUT",
    "motion CASES/subsea-crane.yaml --tp 8,12 --headings 90,180 --quiet --out OUT",
    "pareto CASES/thesis-1975.yaml --points 2 --quiet --out OUT",
    "robust CASES/thesis-1975.yaml --vary rope.length=1500..2000 --starts 1 --draws 20 --quiet "
    "--out OUT",
    "worth CASES/thesis-1975.yaml --starts 1 --quiet --out OUT",
    "sweep CASES/thesis-1975.yaml --samples 16 --quiet --out OUT",
    "sweep CASES/thesis-1975.yaml --samples 2 --mode time --duration '20 s' --jobs 1 --quiet "
    "--no-figures --out OUT",
    "simulate CASES/thesis-1975.yaml --set sea.significant_height=0.5 --duration '30 s' --quiet "
    "--out OUT",
    "simulate CASES/thesis-1975.yaml --controller none,feed-forward --duration '30 s' --quiet "
    "--no-figures --traces netcdf --out OUT",
    "compare CASES/thesis-1975.yaml --controllers none,feed-forward --seeds 1 --duration '30 s' "
    "--jobs 1 --quiet --out OUT",
    "sea CASES/subsea-crane.yaml --quiet --out OUT",
    "sea OUT/buoy.txt --quiet --out OUT",
    "vessel import osv-83m --quiet --out OUT",
)

BUOY = """#YY MM DD hh mm 0.04 0.06 0.08 0.10 0.15 0.20 0.30
2020 01 01 00 00 0.00 2.00 5.50 1.00 0.30 0.10 0.10
2020 01 01 01 00 0.10 12.00 350.00 420.50 60.00 9.90 0.90
"""


@dataclass(frozen=True, kw_only=True)
class FaceGroup:
    """A function that looks at faces, and whether it takes long."""

    name: str
    look: Callable[[], dict[str, object]]
    slow: bool

    def faces(self) -> dict[str, object]:
        """Return what it sees, as JSON has it."""
        with _plain(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return self.look()


@contextlib.contextmanager
def _plain() -> Iterator[None]:
    """A terminal of 100 columns without colours."""
    wanted = {"COLUMNS": "100", "NO_COLOR": "1"}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def call(words: list[str]) -> tuple[int, str]:
    """Return the exit code of a call and what it printed."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
        try:
            code = main(words)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    return int(code or 0), said.getvalue()


def words_of(line: str, out: str = "OUT") -> list[str]:
    """Return the words of a call."""
    return shlex.split(line.replace("CASES", str(HERE / "cases")).replace("OUT", out))


def help_texts() -> dict[str, object]:
    """Return what `--help` says, of all and of each command."""
    calls = [
        [],
        *([name] for name in COMMANDS),
        *(["vessel", w] for w in ("import", "hull", "list")),
    ]
    return {
        " ".join([*words, "--help"]): call([*words, "--help"])[1].splitlines() for words in calls
    }


def exit_codes() -> dict[str, object]:
    """Return the exit codes of good and bad calls, and that every command of the help is known."""
    found: dict[str, object] = {line: call(words_of(line))[0] for line in CALLS}
    said = call(["--help"])[1]
    found["commands"] = re.findall(r"(?m)^    ([a-z]+)(?= |$)", said)
    return found


def files() -> dict[str, object]:
    """Return exit code and names of files of every command that writes some."""
    found: dict[str, object] = {}
    for line in WRITERS:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out"
            out.mkdir()
            if "buoy" in line:
                (out / "buoy.txt").write_text(BUOY, encoding="utf-8")
                (out / LIST).write_text("buoy.txt\n", encoding="utf-8")  # as if it were ours
            code, _ = call(words_of(line, str(out)))
            every = (p.relative_to(out).as_posix() for p in out.rglob("[!.]*") if p.is_file())
            names = sorted({re.sub(r"\.zarr/.*", ".zarr", name) for name in every})
            found[line] = {"exit": code, "files": names}
    return found


GROUPS = {
    group.name: group
    for group in (
        FaceGroup(name="faces_help", look=help_texts, slow=False),
        FaceGroup(name="faces_exit", look=exit_codes, slow=False),
        FaceGroup(name="faces_files", look=files, slow=True),
    )
}
