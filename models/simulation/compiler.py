"""The C compiler: from source to a loaded library, compiled once and kept.

A simulation spends its time in one recursion (`models.simulation.kernel`); CasADi writes it as C,
and this file turns that into a shared library with whatever C compiler the machine has. Libraries
are kept in the user's cache folder under a name made of a digest of everything they depend on and a
digest of their own bytes, so the next run finds its own and a file that was cut short is seen
before it is loaded.  A library is code, so the folder is its user's alone, and what others own or
may write is not loaded.  No file is ever changed in place: several processes may build the same
library at once.
"""

import atexit
import contextlib
import ctypes
import functools
import hashlib
import os
import platform
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..basics import SolverError, cache_folder, keep_latest
from ..sensing import NativeLaw

# No fast-math and no fused multiply-add: the compiled recursion must give the same numbers as
# CasADi's virtual machine.  Hidden symbols cannot clash with those of another library.
FLAGS = ("-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
LONG_SOURCE = 500_000  # [characters] beyond it -O2 takes far longer than -O1 and gains nothing
TIME_LIMIT = 600.0  # [s] for one compilation
KEPT = 256  # libraries kept in the cache; the ones longest unused go first
_SOURCE_NAME = "kernel.c"  # the same for all: it ends up in the library's bytes


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """A C compiler: program and arguments that come before ours, and its version's first line.

    That is part of every library's name.
    """

    command: tuple[str, ...]
    version: str


def find_compiler() -> Compiler | None:
    """Return the C compiler: ``$CC``, else cc, gcc or clang; None if there is none to use.

    The environment variable ``STILLHOOK_COMPILE=0`` says that none may be used.
    """
    if os.environ.get("STILLHOOK_COMPILE", "").strip() == "0":
        return None
    for text in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        try:
            words = shlex.split(text, posix=os.name == "posix")
        except ValueError:  # quotes that do not close
            continue
        program = shutil.which(words[0]) if words else None
        # One that lies in the current folder (Windows looks there first) is not meant.
        if program and (os.path.isabs(program) or os.path.dirname(words[0])):
            command = (program, *words[1:])
            stamp = os.stat(program)
            version = _version(command, stamp.st_mtime_ns, stamp.st_size)
            if version is not None:
                return Compiler(command=command, version=version)
    return None


@functools.lru_cache(maxsize=8)
def _version(command: tuple[str, ...], changed: int, size: int) -> str | None:
    """Return what a compiler says it is; `changed` and `size` tell one that was replaced."""
    del changed, size
    try:
        answer = _run((*command, "--version"), None, 60.0)
    except (OSError, subprocess.SubprocessError):
        return None
    return _first_line(answer.stdout) if answer.returncode == 0 else None


def load_library(
    source: str | Mapping[str, str], compiler: Compiler, law: NativeLaw | None = None
) -> ctypes.CDLL:
    """Return C sources as one loaded library, from the cache if they were compiled before.

    One whole source, or the texts of sources and headers by their names, with what a `law` among
    them has copied and linked.  Symbols to be found must be exported, the rest stays hidden.

    Raises SolverError if the compiler fails or its library cannot be loaded; its first words are
    quoted.
    """
    files = {_SOURCE_NAME: source} if isinstance(source, str) else dict(source)
    copied = {} if law is None else {name: path.read_bytes() for name, path in law.copied.items()}
    links = () if law is None else law.links
    longest = max(map(len, files.values()))
    flags = FLAGS if longest < LONG_SOURCE or law is not None else ("-O1", *FLAGS[1:])
    machine = f"{platform.system()} {platform.machine()}"  # homes are shared between machines
    texts = (source,) if isinstance(source, str) else [t for pair in files.items() for t in pair]
    digests = [f"{name} {hashlib.sha256(data).hexdigest()}" for name, data in copied.items()]
    parts = (*texts, *digests, machine, compiler.version, *compiler.command, *flags, *links)
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:40]
    reason: object = "no folder can be written to"
    for place in (_kept_folder, _own_folder):
        try:
            folder = place()
            found = _load_kept(folder, key)
            if found is not None:
                return found
            with tempfile.TemporaryDirectory(prefix="build-", dir=folder) as scratch:
                sources = [name for name in files if name.endswith(".c")]
                words, name = (*flags, *sources, *links, "-lm"), f"kernel{_suffix()}"
                built = compile_into(Path(scratch), {**files, **copied}, words, name, compiler)
                built.chmod(0o700)
                library = folder / _name(key, built.read_bytes())
                os.replace(built, library)
            keep_latest(folder, f"*{_suffix()}", KEPT)
            return ctypes.CDLL(str(library))
        # A folder that may not be written, or not be run from; a user without a home.
        except (OSError, RuntimeError) as error:
            reason = error
    raise SolverError(f"C compiler: the library can be kept or loaded nowhere: {reason}")


def _load_kept(folder: Path, key: str) -> ctypes.CDLL | None:
    """Return the library of that key if the folder holds it whole; remove spoilt ones."""
    try:
        kept = sorted(folder.glob(f"{key}-*{_suffix()}"))
    except OSError:
        return None
    for path in kept:
        try:
            # Loading a file that was cut short can end the process, so look first.
            if _ours(path) and path.name == _name(key, path.read_bytes()):
                library = ctypes.CDLL(str(path))
                with contextlib.suppress(OSError):
                    os.utime(path)  # used today: the last to be tidied away
                return library
        except OSError:
            pass
        with contextlib.suppress(OSError):
            path.unlink()
    return None


def compile_into(
    folder: Path,
    contents: Mapping[str, str | bytes],
    words: Sequence[str],
    built: str,
    compiler: Compiler,
    *,
    failure: str | None = None,
) -> Path:
    """Write sources and what goes with them into a folder, and compile them there.

    Parameters
    ----------
    folder
        A folder that holds nothing else.
    contents
        Texts and bytes by path within it.
    words
        What the compiler is told besides what it is to build: flags, sources, libraries.
    built
        The file that it is to build.
    compiler, failure
        Who does it, and what an error begins with.

    Raises
    ------
    SolverError
        If the compiler fails; its first words are quoted.
    """
    for name, content in contents.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content.encode() if isinstance(content, str) else content)
    owner = failure or f"C compiler: {compiler.command[0]} failed"
    try:
        answer = _run((*compiler.command, "-o", built, *words), folder, TIME_LIMIT)
    except (OSError, subprocess.SubprocessError) as error:
        raise SolverError(f"{owner}: {error}") from error
    if answer.returncode != 0 or not (folder / built).exists():
        said = _first_line(answer.stderr) or f"it ended with code {answer.returncode}"
        raise SolverError(f"{owner}: {said}")
    return folder / built


def _run(
    command: tuple[str, ...], folder: Path | None, limit: float
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "LC_ALL": "C"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        timeout=limit,
        check=False,
    )


def _kept_folder() -> Path:
    """Return the folder of libraries in the cache, made if need be; nobody else may look into it.

    Raises OSError if it cannot be made, or is somebody else's.
    """
    folder = cache_folder() / "kernels"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not _ours(folder):
        folder.chmod(0o700)  # fails where it is another's
        if not _ours(folder):
            raise PermissionError(f"{folder}: is not this user's own")
    return folder


def _ours(path: Path) -> bool:
    """Return whether a file or folder, no link, is this user's and nobody else may write it."""
    if os.name != "posix":
        return True  # the rights of a user's own cache folder hold for what is in it
    found = path.lstat()
    mine = found.st_uid == os.geteuid() and not stat.S_ISLNK(found.st_mode)
    return mine and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@functools.lru_cache(maxsize=1)
def _own_folder() -> Path:
    """Return a temporary folder of this process, for when the cache cannot be written."""
    folder = tempfile.mkdtemp(prefix="stillhook-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:16]}{_suffix()}"


def _suffix() -> str:
    return {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def _first_line(text: str) -> str:
    """Return the first line that says something, the one with an error if there is one."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if "error" in line.lower()), lines[0] if lines else "")
