"""An FMU as one file: description, sources and, where there is a C compiler, a library.

Description, C of a model --> NAME.fmu, NAME_OspModelDescription.xml

The model's C is what `slave.c` asks for in ``model.h``: `model_header` writes its beginning.
"""

from __future__ import annotations

import io
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from models.basics import InputError
from models.simulation import Compiler, compile_into, find_compiler

from .description import Description, guid_of, model_description, osp_description

UNPROVED = "It was not compiled: there is no C compiler on the machine that wrote it."
NO_FMPY = "an FMU cannot be made: it needs fmpy: run `make export`"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
"""What a compiler is told: the numbers of the simulation, and no name outside but FMI's."""

HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
SLAVE = "slave.c"
_STAMP = (1980, 1, 1, 0, 0, 0)  # of every file in the archive: the same export, the same bytes
_README = """\
{name}: sources of an FMU (FMI 2.0 for Co-Simulation), written by Stillhook.

Built here with
  cc {flags} -o {name}.so {sources} {links}
-ffp-contract=off keeps every number as in the simulation.

fmi2*.h: Modelica Association Project FMI, 2-clause BSD licence, as each says at its head.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class FmuModel:
    """What becomes an FMU."""

    told: Description
    header: str  #: What ``model.h`` has beside sizes and guid: includes, ``Model``, functions.
    sources: Mapping[str, str]  #: C and headers by name, without ``model.h`` and the slave.
    #: Files that are copied as they are, by their path beside the sources, and which are linked.
    copied: Mapping[str, Path] = field(default_factory=dict)
    links: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Fmu:
    """An FMU that has been made."""

    name: str
    content: bytes  #: Of NAME.fmu.
    osp: str  #: Of NAME_OspModelDescription.xml.
    compiler: Compiler | None  #: What its library was compiled with; None if it has sources alone.
    platform: str  #: What the library is for, as FMI calls it.

    @property
    def files(self) -> dict[str, str | bytes]:
        """The two files by name."""
        return {f"{self.name}.fmu": self.content, f"{self.name}_OspModelDescription.xml": self.osp}

    @property
    def built(self) -> str:
        """Which library is in it, in sentences."""
        if self.compiler is None:
            return (
                "It has sources alone, as there was no C compiler on the machine that wrote it: "
                "`sources/README.txt` says how the library is built."
            )
        return (
            f"The library in it is for {self.platform}; for another machine it is built from "
            "`sources`, whose README.txt says how."
        )


def make_fmu(model: FmuModel) -> Fmu:
    """Return the FMU of a model, with a library for this machine if there is a C compiler.

    Raises InputError if the headers of FMI, which fmpy brings, are not there; SolverError if the
    compiler fails.
    """
    told = model.told
    sources: dict[str, str | bytes] = dict(model.sources)
    sources[SLAVE] = (Path(__file__).parent / SLAVE).read_text(encoding="utf-8")
    sources |= {path: file.read_bytes() for path, file in model.copied.items()}
    sources |= {name: (_headers() / name).read_bytes() for name in HEADERS}
    guid = guid_of(told, {**sources, "model.h": model.header})
    sources["model.h"] = _model_header(told, guid, model.header)
    compiled = sorted(name for name in (*model.sources, SLAVE) if name.endswith(".c"))
    sources["README.txt"] = _README.format(
        name=told.name,
        flags=" ".join(FLAGS),
        sources=" ".join(compiled),
        links=" ".join((*_linked(model.links), "-lm")),
    )
    files: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(told, guid, compiled),
        **{f"sources/{name}": content for name, content in sorted(sources.items())},
    }
    compiler = find_compiler()
    if compiler is not None:
        folder, suffix = _platform()
        place = f"binaries/{folder}"
        files[f"{place}/{told.name}{suffix}"] = _library(
            told.name, sources, compiled, model.links, compiler
        )
        # A library that is linked is looked for beside ours.
        for path in model.links:
            if not path.endswith(".a"):
                files[f"{place}/{Path(path).name}"] = sources[path]
    return Fmu(
        name=told.name,
        content=_zip(files),
        osp=osp_description(told),
        compiler=compiler,
        platform=_platform()[0],
    )


def milliseconds(time: float) -> str:
    """Return a time [s] as it is told in texts."""
    return f"{1e3 * time:g} ms"


def _headers() -> Path:
    """Return the folder of FMI's headers.

    Raises InputError if fmpy, which brings them, is not installed.
    """
    found = find_spec("fmpy")
    if found is None or found.origin is None:
        raise InputError(NO_FMPY)
    return Path(found.origin).parent / "c-code"


def _model_header(told: Description, guid: str, body: str) -> str:
    """Return ``model.h``: guid, how many variables there are, and what the model declares."""
    reals = told.of_kind("Real")
    inputs = [variable for variable in reals if variable.causality == "input"]
    integers = told.of_kind("Integer")
    strings = [str(variable.start) for variable in told.of_kind("String")]
    quoted = ", ".join(
        '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"' for text in strings
    )
    return f"""\
#ifndef MODEL_H
#define MODEL_H

#define MODEL_GUID "{guid}"
/* How many there are; of the real ones the inputs come first, and only they may be set. */
#define MODEL_REALS {len(reals)}
#define MODEL_INPUTS {len(inputs)}
#define MODEL_INTEGERS {len(integers)}
#define MODEL_STRINGS {len(strings)}

static const char *const model_strings[MODEL_STRINGS] = {{{quoted}}};

{body}
/* Forget everything, as at first. */
void model_reset(Model *model);
/* Make the outputs of the inputs at the start; may be called several times. */
void model_begin(Model *model);
/* Go on from a time since the start over a step [s]; says why if that cannot be. */
const char *model_step(Model *model, double elapsed, double step);

#endif
"""


def _library(
    name: str,
    sources: Mapping[str, str | bytes],
    compiled: Sequence[str],
    links: Sequence[str],
    compiler: Compiler,
) -> bytes:
    """Return the shared library, compiled in a folder that holds nothing else.

    Raises SolverError if the compiler fails; what it says is quoted.
    """
    with tempfile.TemporaryDirectory(prefix="stillhook-") as scratch:
        built = compile_into(
            Path(scratch),
            sources,
            [*FLAGS, *compiled, *_linked(links), "-lm"],
            f"{name}{_platform()[1]}",
            compiler,
            failure="export: fmu: it cannot be compiled",
        )
        return built.read_bytes()


def _linked(links: Sequence[str]) -> list[str]:
    """Return what links libraries that lie beside ours: by name, whatever the folder."""
    words: list[str] = []
    for path in links:
        where, _, name = path.rpartition("/")
        words += [path] if path.endswith(".a") else [f"-L{where or '.'}", f"-l:{name}"]
    if any(not path.endswith(".a") for path in links):
        words.append("-Wl,-rpath,$ORIGIN")
    return words


def _platform() -> tuple[str, str]:
    """Return what FMI 2.0 calls this machine's kind, and how its libraries end."""
    system, suffix = {"win32": ("win", ".dll"), "darwin": ("darwin", ".dylib")}.get(
        sys.platform, ("linux", ".so")
    )
    return f"{system}{64 if sys.maxsize > 2**32 else 32}", suffix


def _zip(files: Mapping[str, str | bytes]) -> bytes:
    """Return an archive whose bytes hang on names and contents alone."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _STAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, content)
    return packed.getvalue()
