"""Lazy faces of packages: a name is imported when it is first asked for.

A face lists what it hands on under ``if TYPE_CHECKING``, so that type checkers, the import
contract and readers all see the same list, and nothing has to be written twice.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_face(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package (PEP 562).

    The package is given by its ``__name__`` and its ``__file__``, whose ``if TYPE_CHECKING`` says
    where each name comes from.  A name must not be that of a module in the package: once imported,
    the module would hide it.
    """
    homes: dict[str, str] = {}
    for block in ast.parse(Path(file).read_text(encoding="utf-8")).body:
        if isinstance(block, ast.If):
            for line in block.body:
                if isinstance(line, ast.ImportFrom):
                    home = "." * line.level + (line.module or "")
                    homes |= {name.name: home for name in line.names}

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name], package), name)

    names = sorted(homes)
    return get, lambda: names, names
