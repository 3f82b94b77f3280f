"""Digests of code: which code made a result, whatever its comments say.

    entry function --> files that it imports, and theirs ... --> syntax trees --> `code_digest`

A store of results is only gone on with by the code that began it, a cluster's workers must have
the driver's, and stored studies say what made them: other code may give other numbers, and a table
of both would be worth nothing.
"""

import ast
import gc
import hashlib
import platform
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from typing_extensions import TypeIs

_PACKAGES = ("models", "synth", "mpc", "stillhook")
_NUMERICAL = ("numpy", "scipy", "casadi", "daqp")


@lru_cache(maxsize=32)
def code_digest(entry: Callable[..., object] | str, beside: frozenset[str] = frozenset()) -> str:
    """Return a digest of the code that the results of a function, class or module hang on.

    That is the file of the function and every file that it imports, directly or through others,
    within the toolkit, the function's own package and the modules `beside` it, such as the scripts
    that a script imports: at the top or later, in a function.  What is imported for type checkers
    alone cannot change a number and does not count.  A face (`models.basics.lazy`) is looked
    through to the file that a name comes from, also where it is imported whole and only its names
    are used (``import stillhook as sh``).  Of each file the syntax tree without its docstrings
    counts, so that words, comments and line breaks may change; and so do the versions of the
    numerical libraries.
    """
    start = entry if isinstance(entry, str) else entry.__module__
    digest = hashlib.sha256()
    for name, package in sorted((name, version(name)) for name in _NUMERICAL):
        digest.update(f"{name} {package}\n".encode())
    # The trees live until the end and hold no circles: looking for garbage would take twice as
    # long as reading them.
    collecting = gc.isenabled()
    gc.disable()
    try:
        for module, content in sorted(_Reached(start, beside).contents.items()):
            digest.update(f"{module} {content}\n".encode())
    finally:
        if collecting:
            gc.enable()
    return digest.hexdigest()[:16]


def versions(entry: Callable[..., object] | str) -> dict[str, str]:
    """Return the versions of Stillhook, the libraries, the code behind an entry, and Python."""
    from .._version import __version__

    found = {"stillhook": __version__, **{name: version(name) for name in _NUMERICAL}}
    return {**found, "code": code_digest(entry), "python": platform.python_version()}


class _Reached:
    """The files that a module reaches, with a digest of each, by the module's name."""

    def __init__(self, start: str, beside: frozenset[str] = frozenset()) -> None:
        self._ours = {*_PACKAGES, start.partition(".")[0], *beside}
        self._faces: dict[str, dict[str, tuple[str, str]]] = {}
        self._homes: dict[str, Path | None] = {}
        self.contents: dict[str, str] = {}
        todo = [start]
        while todo:
            module = todo.pop()
            path = self._file(module)
            if module in self.contents or path is None:
                continue
            file = _contents(path, path.stat().st_mtime_ns)
            self.contents[module] = file.digest
            # That relative imports start from.
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            for line in file.imports:
                todo += self._targets(line, package, file.used)
            if path.name == "__init__.py":  # imported as a whole: all that it hands on
                todo += [self._source(*home) for home in self._face(module, path).values()]

    def _targets(
        self, line: ast.Import | ast.ImportFrom, package: str, used: Mapping[str, frozenset[str]]
    ) -> Iterator[str]:
        """Yield the modules that an import in a package brings."""
        if isinstance(line, ast.Import):
            for each in line.names:
                path, names = self._file(each.name), used.get(each.asname or each.name)
                face = path is not None and path.name == "__init__.py"
                handed = self._face(each.name, path) if path and face else {}
                if names and names <= handed.keys():
                    yield from (self._source(each.name, name) for name in sorted(names))
                else:
                    yield each.name
            return
        base = _absolute(line, package)
        yield from (self._source(base, each.name) for each in line.names)

    def _source(self, base: str, name: str) -> str:
        """Return the module in which a name that is imported from another stands."""
        if self._file(f"{base}.{name}") is not None:
            return f"{base}.{name}"
        path = self._file(base)
        if path is not None and path.name == "__init__.py":
            home = self._face(base, path).get(name)
            if home is not None:
                return self._source(*home)
        return base

    def _face(self, module: str, path: Path) -> dict[str, tuple[str, str]]:
        """Return where the names that a face hands on come from: module and name there."""
        if module not in self._faces:
            found: dict[str, tuple[str, str]] = {}
            for block in ast.parse(path.read_bytes()).body:
                for line in block.body if _for_types_alone(block) else ():
                    if isinstance(line, ast.ImportFrom):
                        base = _absolute(line, module)
                        found |= {e.asname or e.name: (base, e.name) for e in line.names}
            self._faces[module] = found
        return self._faces[module]

    def _file(self, module: str) -> Path | None:
        """Return the file of a module; None if it is none of ours, or no module."""
        if module not in self._homes:
            top, _, rest = module.partition(".")
            spec = find_spec(top) if top in self._ours else None
            place = None if spec is None or spec.origin is None else Path(spec.origin)
            if place is not None and rest:
                below = place.parent.joinpath(*rest.split("."))
                both = (below / "__init__.py", below.with_suffix(".py"))
                place = next((path for path in both if path.is_file()), None)
            self._homes[module] = place
        return self._homes[module]


@dataclass(frozen=True)
class _File:
    """What counts of a file."""

    digest: str
    imports: tuple[ast.Import | ast.ImportFrom, ...]
    #: Attributes by the name that they are used of; nothing of a name that is used otherwise too.
    used: Mapping[str, frozenset[str]]


@lru_cache(maxsize=1024)  # entries share most of their files
def _contents(path: Path, changed: int) -> _File:
    """Return what counts of a file, as it is since a time [ns]."""
    del changed
    words: list[str] = []
    imports: list[ast.Import | ast.ImportFrom] = []
    tree = ast.parse(path.read_bytes())
    _read(tree, words, imports)
    digest = hashlib.sha256("\0".join(words).encode()).hexdigest()
    whole = any(
        each.name.partition(".")[0] in _PACKAGES
        for line in imports
        if isinstance(line, ast.Import)
        for each in line.names
    )
    return _File(digest, tuple(imports), _used(tree) if whole else {})


def _used(tree: ast.AST) -> dict[str, frozenset[str]]:
    """Return the attributes that a file uses of each name that it uses for nothing else."""
    found: dict[str, set[str]] = {}
    names = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found.setdefault(node.value.id, set()).add(node.attr)
            names[node.value.id] -= 1
    return {name: frozenset(those) for name, those in found.items() if not names[name]}


def _absolute(line: ast.ImportFrom, package: str) -> str:
    """Return the full name of the module that something is imported from."""
    if not line.level:
        return line.module or ""
    parts = package.split(".")[: len(package.split(".")) - line.level + 1]
    return ".".join([*parts, *([line.module] if line.module else [])])


def _for_types_alone(node: ast.AST) -> TypeIs[ast.If]:
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def _read(node: ast.AST, words: list[str], imports: list[ast.Import | ast.ImportFrom]) -> None:
    """Gather a syntax tree as words, the same for every version of Python, and its imports."""
    if _for_types_alone(node):
        for other in node.orelse:
            _read(other, words, imports)
        return
    words.append(type(node).__name__)
    if isinstance(node, ast.Import | ast.ImportFrom):
        imports.append(node)
    for field in node._fields:
        value = getattr(node, field, None)
        # Fields that only some versions have are empty lists where nothing is said.
        if value is None or field == "ctx" or value == []:
            continue
        words.append(field)
        if isinstance(value, ast.AST):
            _read(value, words, imports)
        elif not isinstance(value, list):
            words.append(repr(value))
        else:
            for each in value:
                if not isinstance(each, ast.AST):
                    words.append(repr(each))
                # A text that stands alone does nothing: a docstring.
                elif not (
                    isinstance(each, ast.Expr)
                    and isinstance(each.value, ast.Constant)
                    and isinstance(each.value.value, str)
                ):
                    _read(each, words, imports)
            words.append(")")
