"""The kinds of sea by their names, and which fields each of them takes."""

from __future__ import annotations

from collections.abc import Callable

from ..basics import InputError, check_range

STANDARD_SPECTRA = (
    "bretschneider-1975", "bretschneider", "pierson-moskowitz", "jonswap", "tma", "torsethaugen",
    "ochi-hubble", "gaussian-swell",
)  # fmt: skip
"""The standard forms by their names in a case file."""

SPECTRA = (*STANDARD_SPECTRA, "measured", "sum")
"""All spectra by their names in a case file."""

FIELDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(STANDARD_SPECTRA, ("peak_period",)),
    "bretschneider-1975": ("significant_period",),
    "pierson-moskowitz": (),
    "tma": ("peak_period", "depth"),
    "gaussian-swell": ("peak_period", "width"),
    "measured": ("table",),
    "sum": ("parts",),
}
"""What each kind needs, besides the height that all standard forms do."""

_UNITS = {"peak_period": "s", "significant_period": "s", "depth": "m", "width": "rad/s"}


def takes(kind: str) -> str:
    """Return what a kind takes, in words.

    Examples
    --------
    >>> takes("tma"), takes("pierson-moskowitz")
    ('peak_period [s], depth [m]', 'no period')
    """
    named = [f"{name} [{_UNITS[name]}]" if name in _UNITS else name for name in FIELDS[kind]]
    return ", ".join(named) or "no period"


def check_fields(kind: str, value_of: Callable[[str], object]) -> None:
    """Check that a sea has the fields of its kind and none of another's.

    Parameters
    ----------
    kind
        One of :data:`SPECTRA`.
    value_of
        Value of a field by its name; None where it is not given.

    Raises
    ------
    InputError
        If one is missing, is not for the kind, or is out of range.
    """
    for name in dict.fromkeys(name for names in FIELDS.values() for name in names):
        if name not in FIELDS[kind] and value_of(name) is not None:
            raise InputError(f"sea: spectrum {kind} takes {takes(kind)}, not {name}")
    for name in FIELDS[kind]:
        value, unit = value_of(name), _UNITS.get(name, "")
        if value is None:
            raise InputError(f"sea: spectrum {kind} needs {name}" + (f" [{unit}]" if unit else ""))
        if unit and isinstance(value, int | float):
            check_range("sea", name, value, low=0.0, unit=unit, open_low=True)
