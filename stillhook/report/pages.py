"""The pages of a report: HTML of one file by Jinja, and PDF by Typst, from the same parts.

    Document.pages() --> html_text, pdf_bytes

Both are a template beside this file that is given plain data, so that they cannot say different
things.  Neither asks for anything from anywhere: figures are inside, with the glyphs they use.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from models.basics import StillhookError

from ..text import characters_of, font_face

_HERE = Path(__file__).parent
_LONG = re.compile(r"([a-z][._/](?=[a-z])|[0-9a-f]{16}(?=[0-9a-f]))")
"""Where long names and hashes may break."""


def html_text(pages: Mapping[str, Any]) -> str:
    """Return a report as one page of HTML that needs nothing beside it."""
    import jinja2

    maker = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    shown: dict[Any, set[str]] = {}
    for svg in _figures(pages["chapters"]):
        for face, characters in characters_of(svg).items():
            shown.setdefault(face, set()).update(characters)
    font = "".join(font_face(characters, [face]) for face, characters in sorted(shown.items()))
    text: str = maker.get_template("report.html.jinja").render(pages, font=font)
    return f"{text.strip()}\n"


def can_typeset() -> bool:
    """Return whether Typst is there, the extra ``report``."""
    return find_spec("typst") is not None


def pdf_bytes(pages: Mapping[str, Any]) -> bytes:
    """Return a report as PDF (A4), with text that can be searched; the same pages give the same.

    Raises StillhookError if Typst cannot set it.
    """
    import matplotlib

    typst = import_module("typst")
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    try:
        made: bytes = typst.compile(
            (_HERE / "report.typ").read_bytes(),
            font_paths=[str(fonts)],
            ignore_system_fonts=True,
            sys_inputs={"document": json.dumps(_breakable(pages), ensure_ascii=False)},
            timestamp=0,
        )
    except RuntimeError as error:
        raise StillhookError(f"report: the PDF could not be set: {error}") from error
    return made


def _figures(parts: Any) -> Iterator[str]:
    for part in parts:
        if part["kind"] == "figure":
            yield part["svg"]
        elif part["kind"] == "section":
            yield from _figures(part["items"])


def _breakable(part: Any, name: str = "") -> Any:
    """Return pages whose long words may break at the end of a line; HTML lets them by itself."""
    if isinstance(part, dict) and part.get("kind") == "listing":
        return part  # to be copied
    if isinstance(part, dict):
        return {key: _breakable(item, key) for key, item in part.items()}
    if isinstance(part, list):
        return [_breakable(item, name) for item in part]
    return _LONG.sub("\\1\u200b", part) if name in ("text", "origin") else part
