"""The guard at the front door: `models`, `synth` and `mpc` have to be Stillhook's own.

Stillhook's parts are top-level packages with plain names, so a user's own `models.py` beside
a script hides the package of that name, and the first sign would be an odd AttributeError
deep inside.  `stillhook/__init__.py` therefore asks once, before anything else is imported,
where the three names lead.  Looking them up costs a few file system calls and runs none of
their code.
"""

import importlib.util
from pathlib import Path

SIBLINGS = ("models", "synth", "mpc")


def check_siblings() -> None:
    """Check that the packages that Stillhook is made of stand beside `stillhook` itself.

    Raises ImportError if a name leads to another file, which the message names, or nowhere.
    """
    home = Path(__file__).resolve().parent.parent
    for name in SIBLINGS:
        found = _location(name)
        wanted = home / name
        if found is None:
            raise ImportError(
                f"Stillhook's package `{name}` is missing from {home}: install stillhook again.",
                name=name,
            )
        if found.resolve() not in (wanted, wanted / "__init__.py"):
            raise ImportError(
                f"`import {name}` finds {found} instead of Stillhook's own package in {wanted}: "
                "rename that file or folder, or run Python where it is not on the path.",
                name=name,
                path=str(found),
            )


def _location(name: str) -> Path | None:
    """Return the file that `import name` would run, or the folder if it has no `__init__.py`."""
    spec = importlib.util.find_spec(name)
    if spec is None:
        return None
    if spec.origin is not None:
        return Path(spec.origin)
    for folder in spec.submodule_search_locations or ():
        return Path(folder)
    return None
