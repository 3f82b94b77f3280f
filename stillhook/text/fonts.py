"""The font of figures and pages, as much of it as they use: CSS that carries the glyphs.

DejaVu Sans comes with matplotlib, which measures with it whatever a figure says: a reader that has
these glyphs sees every word where it was put.  Whoever hands them on owes their copyright a place.
"""

import base64
import io
import logging
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

Face = Literal["regular", "bold", "oblique", "bold oblique"]

FAMILY = "DejaVu Sans"  #: Family that figures are drawn in.
#: Where a reader takes no font from a file: Verdana is as wide, being of the same hand.
FAMILIES = f"'{FAMILY}', Verdana, sans-serif"

_FILES: dict[Face, str] = {
    "regular": "DejaVuSans.ttf",
    "bold": "DejaVuSans-Bold.ttf",
    "oblique": "DejaVuSans-Oblique.ttf",
    "bold oblique": "DejaVuSans-BoldOblique.ttf",
}
_NOTICES = [0, 14]  # entries of a font's table of names: its copyright, and where its licence is
_UNUSED = ["FFTM", "GSUB", "MATH", "gasp"]  # tables: times of making, ligatures, formulas, hints


def font_face(text: Iterable[str], faces: Iterable[Face] = ("regular",)) -> str:
    """Return CSS with the glyphs of a text, a rule ``@font-face`` for each face.

    The same characters give the same CSS, whatever their order.  Characters that the font does
    not have are left to the fonts of the reader, see `FAMILIES`.

    Examples
    --------
    >>> font_face("still")[:44]
    "@font-face{font-family:'DejaVu Sans';font-we"
    >>> font_face("still", ["bold", "oblique"]).count("@font-face")
    2
    """
    characters = frozenset("".join(text))
    return "".join(_rule(characters, face) for face in faces)


@lru_cache(maxsize=64)
def _rule(characters: frozenset[str], face: Face) -> str:
    weight = 700 if "bold" in face else 400
    style = "oblique" if "oblique" in face else "normal"
    data = base64.b64encode(_subset(characters, face)).decode("ascii")
    return (
        f"@font-face{{font-family:'{FAMILY}';font-weight:{weight};font-style:{style};"
        f"src:url(data:font/woff;base64,{data}) format('woff')}}"
    )


def _subset(characters: frozenset[str], face: Face) -> bytes:
    """Return a font file (WOFF) with the glyphs of some characters, and their kerning."""
    import matplotlib
    from fontTools.subset import Options, Subsetter
    from fontTools.ttLib import TTFont

    logging.getLogger("fontTools").setLevel(logging.ERROR)
    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / _FILES[face]
    options: Any = Options()
    options.drop_tables += _UNUSED
    options.bidi_closure = False  # none is ever mirrored
    options.hinting = False
    options.layout_features = ["kern"]  # matplotlib kerns, too
    options.name_IDs = _NOTICES
    target = io.BytesIO()
    # With the time of today in it the same figure would give another file.
    with TTFont(file, lazy=True, recalcTimestamp=False) as font:
        subsetter = Subsetter(options)
        subsetter.populate(text="".join(sorted(characters)))
        subsetter.subset(font)
        font.flavor = "woff"
        font.save(target)
    return target.getvalue()
