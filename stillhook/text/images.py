"""Figures as images: SVG whose words are text, as a file or within a page, and PNG.

    Figure --matplotlib--> SVG --> words joined, ids of its own, title and finding, font --> SVG

Words can be selected and found, and whoever does not see a figure is told what it shows and what
it found.  A file carries the glyphs that it uses (`stillhook.text.fonts`); a page with many figures
carries them once.
"""

import io
import re
from itertools import groupby
from xml.etree import ElementTree as ET

from .fonts import FAMILIES, FAMILY, Face, font_face
from .style import Figure, styled, untypeset
from .table import Drawing

_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'
_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
#: What holds for all of a figure, and for nothing else on a page.
_INHERITED = {"font-family": FAMILIES, "stroke-linecap": "butt", "stroke-linejoin": "round"}
#: Without a date the same design gives the same file; the rest says nothing about the figure.
_SILENT = dict.fromkeys(("Creator", "Date", "Format", "Type"))
_BOLD = 600  # weight from which on the bold face is taken


def picture(
    figure: Figure, kind: str, *, name: str = "figure", caption: str = "", font: bool = True
) -> bytes:
    """Return a figure as the contents of a file.

    Parameters
    ----------
    figure
        The figure.
    kind
        ``svg`` or ``png``.
    name
        What the ids in an SVG begin with, so that several can stand in one page.
    caption
        What it shows, the title of an SVG; by default what it found.
    font
        Whether an SVG carries the glyphs that it uses.
    """
    if kind == "svg":
        return f"{_PROLOGUE}{_svg(figure, name, caption, font=font)}\n".encode()
    return _saved(figure, kind, {"Software": "Stillhook"})


def inline_svg(drawing: Drawing) -> str:
    """Return a drawing as an element ``<svg>`` for a page of HTML.

    It leaves the font to the page: `characters_of` says what `font_face` has to hold for it.

    Raises InputError if there is nothing to draw.
    """
    return _svg(drawing.draw(), drawing.name, drawing.caption, font=False)


def characters_of(image: str) -> dict[Face, set[str]]:
    """Return the characters in an SVG of a figure, by the face that shows them."""
    return _characters(ET.fromstring(image))


def _saved(figure: Figure, kind: str, metadata: dict[str, str] | dict[str, None]) -> bytes:
    target = io.BytesIO()
    with styled():
        figure.savefig(target, format=kind, dpi=150, metadata=metadata)
    return target.getvalue()


def _svg(figure: Figure, name: str, caption: str, *, font: bool) -> str:
    root = ET.fromstring(_saved(figure, "svg", _SILENT))
    _shorten(root)
    for text in root.iter("text"):
        _write_words(text)
    # An id has no blanks, and in XML it begins with a letter.
    begin = re.sub(r"[^\w-]+|^(?=[\d-])", "_", name)
    _rename(root, begin)
    for key, value in _INHERITED.items():
        root.set(key, value)
    _embed(root, font=font)
    title, *about = [said for said in (untypeset(caption), *_words(figure)) if said] or [name]
    _tell(root, begin, title, ". ".join(about))
    return ET.tostring(root, encoding="unicode")


def _shorten(root: ET.Element) -> None:
    """Write names without their namespaces, no blanks, and places to a hundredth of a point."""
    for element in root.iter():
        element.tag = _short_name(element.tag)
        element.attrib = {_short_name(name): value for name, value in element.items()}
        element.tail = None
        if len(element):
            element.text = None
        for name in {"d", "x", "y"} & {*element.attrib}:
            value = element.attrib[name]
            element.set(name, _short_path(value) if name == "d" else _rounded(float(value)))
    root.set("xmlns", _SVG)
    root.set("xmlns:xlink", _XLINK)


def _short_name(name: str) -> str:
    return name.removeprefix(f"{{{_SVG}}}").replace(f"{{{_XLINK}}}", "xlink:")


def _rounded(length: float) -> str:
    return f"{round(length, 2):.10g}"


def _short_path(path: str) -> str:
    """Return a path with each place as seen from the one before it."""
    parts: list[str] = []
    start = here = [0, 0]
    for command, numbers in re.findall(r"([MLQCz])([^MLQCz]*)", path):
        if command == "z":
            here = start
            parts.append("z")
            continue
        places = [round(100.0 * float(number)) for number in numbers.split()]
        moves = [place - here[k % 2] for k, place in enumerate(places)]
        parts.append(command.lower() + " ".join(_rounded(move / 100.0) for move in moves))
        here = places[-2:]
        start = here if command == "M" else start
    return "".join(parts)


def _write_words(text: ET.Element) -> None:
    """Say nothing that goes without saying, and put the letters of a formula in reading order.

    They come font by font, each by itself.
    """
    letters = sorted(text, key=lambda letter: float(letter.attrib["x"]))
    del text[:]
    for (y, style), run in groupby(letters, lambda each: (each.attrib["y"], each.attrib["style"])):
        runs = [*run]
        places = " ".join(letter.attrib["x"] for letter in runs)
        joined = ET.SubElement(text, "tspan", x=places, y=y, style=style)
        joined.text = "".join(letter.text or "" for letter in runs).replace("\xa0", " ")
    for part in (text, *text):
        style = part.attrib.get("style", "").replace(f"font-family: '{FAMILY}'", "")
        part.set("style", ";".join(filter(None, re.split(r"\s*;\s*", style))))
    if letters or "  " in (text.text or ""):
        text.set("xml:space", "preserve")  # as many spaces as there are places and room for
    if text.get("transform", "").startswith("rotate(-0 "):
        del text.attrib["transform"]


def _rename(root: ET.Element, begin: str) -> None:
    """Give ids that no other figure on a page has to what is referred to, and to nothing else."""
    every = [pair for element in root.iter() for pair in element.items()]
    found = dict.fromkeys(id for pair in every for id in _references(*pair))
    ids = {id: f"{begin}-{k}" for k, id in enumerate(found, 1)}
    for element in root.iter():
        own = ids.get(element.attrib.pop("id", ""))
        for name, value in element.items():
            for id in _references(name, value):
                value = value.replace(f"#{id}", f"#{ids[id]}")
            element.set(name, value)
        if own is not None:
            element.set("id", own)


def _references(name: str, value: str) -> list[str]:
    """Return the ids that an attribute refers to."""
    if name == "xlink:href" and value.startswith("#"):
        return [value[1:]]
    return re.findall(r"url\(#([^)]+)\)", value)


def _embed(root: ET.Element, *, font: bool) -> None:
    """Put the font's rules in the place of matplotlib's, which hold for all of a page."""
    place = root.find("defs")
    assert place is not None  # matplotlib's rules stand there
    root.remove(place)
    if font:
        style = ET.Element("style")
        style.text = "".join(
            font_face(characters, [face]) for face, characters in sorted(_characters(root).items())
        )
        root.insert(0, style)


def _characters(root: ET.Element) -> dict[Face, set[str]]:
    found: dict[Face, set[str]] = {}
    for element in root.iter():
        if element.tag.rpartition("}")[2] in ("text", "tspan") and element.text:
            found.setdefault(_face(element), set()).update(element.text)
    return found


def _face(element: ET.Element) -> Face:
    style = element.get("style", "")
    weight = re.search(r"font-weight: (\d+)", style)
    bold = weight is not None and int(weight[1]) >= _BOLD
    slanted = re.search(r"font-style: (italic|oblique)", style) is not None
    if slanted:
        return "bold oblique" if bold else "oblique"
    return "bold" if bold else "regular"


def _tell(root: ET.Element, begin: str, title: str, about: str) -> None:
    """Say what a figure shows and what it found to whoever does not see it."""
    told = [(what, text) for what, text in (("title", title), ("desc", about)) if text]
    for place, (what, text) in enumerate(told):
        element = ET.Element(what, id=f"{begin}-{what}")
        element.text = text
        root.insert(place, element)
    root.set("role", "img")
    root.set("aria-labelledby", " ".join(f"{begin}-{what}" for what, _ in told))


def _words(figure: Figure) -> list[str]:
    """Return what a figure says of itself: its finding, and what it or its panels are about."""
    titles = [axes.get_title(loc) for axes in figure.axes for loc in ("left", "center", "right")]
    return [" ".join(untypeset(text).split()) for text in (figure.get_suptitle(), *titles)]
