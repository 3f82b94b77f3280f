"""How the documentation is built: `make docs`.

The pages beside this file are Markdown.  What the code says of itself (names, fields of a case
file, fields of results) is put into those of `reference/` and into the glossary while they are
read, by `reference/pages.py`.  Nothing of the site asks another host for anything.
"""

from __future__ import annotations

import importlib.util
import logging
import re
import sys
import tomllib
from pathlib import Path

import latex2mathml.converter
from docutils.nodes import SkipNode
from fontTools import subset

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "reference"))
import pages  # noqa: E402, which stands beside the pages

# A literal, a role or a link, which stay; a name in backticks; a bar.
MARKUP = re.compile(r"``[^`]+``|:[\w:]+:`[^`]+`|`[^`]+`_+|`(?P<name>[^`]+)`|(?P<bar>\|)")
#: Pages that change with the code, and not with their own text.
MADE = ("reference/", "glossary")
logging.getLogger("fontTools").setLevel(logging.WARNING)
#: What formulas are written with: letters, Greek, arrows, operators, brackets, their alphabets.
GLYPHS = (
    *(
        (0x20, 0x7E),
        (0xA0, 0xFF),
        (0x302, 0x30C),
        (0x370, 0x3FF),
        (0x2010, 0x2057),
        (0x20D0, 0x20EF),
    ),
    *((0x2100, 0x214F), (0x2190, 0x21FF), (0x2200, 0x22FF), (0x2308, 0x230B), (0x23B4, 0x23E1)),
    *((0x27E6, 0x27EF), (0x1D400, 0x1D4FF), (0x1D538, 0x1D56B), (0x1D6A4, 0x1D6DB)),
    *((0x1D6DC, 0x1D715), (0x1D7CE, 0x1D7D7)),
)

#: Signs that TeX sets without space: a slash, a bar.
ORDINARY = re.compile(r'<mo(?: stretchy="false")?>(?P<sign>&#x0002F;|&#x0007C;)</mo>')
THIN = '<mspace width="0.167em"/>'
_FUNCTION = r"<mi>(?:arcsin|arctan|cosh?|coth|exp|ln|log|max|min|sign|sinh?|tanh?)</mi>"
AFTER_FUNCTION = re.compile(rf"(?P<function>{_FUNCTION})(?=<(?:mi|mn|msub|mrow|mfrac|msqrt|msup)>)")
BEFORE_FUNCTION = re.compile(rf"(?P<before></(?:mi|mn|msub|msup|mfrac)>)(?P<function>{_FUNCTION})")

project = "Stillhook"
author = "The Stillhook contributors"
copyright = author
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_math_renderer = "mathml"
exclude_patterns = ["_build", "api"]  # `api` was written by earlier versions
html_theme = "furo"
html_title = f"Stillhook {release}"
html_static_path = ["_static"]
html_css_files = ["stillhook.css"]
html_copy_source = False
html_use_index = False

myst_enable_extensions = ["amsmath", "dollarmath", "deflist"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_ivar = True  # a field that has its own docstring too is then described once
# Short names in annotations (`below`, `type`) that several classes have: nothing to link to.
suppress_warnings = ["ref.python"]


def fill(_app, name: str, source: list[str]) -> None:
    """Put what the code says into a page before it is read."""
    if name.startswith(MADE):
        source[0] = pages.filled(source[0])


def outdated(_app, env, _added, _changed, _removed) -> list[str]:
    """Return the pages that are read anew in every build."""
    return [name for name in env.found_docs if name.startswith(MADE)]


def plain_text(_app, _what, _name, _obj, _options, lines: list[str]) -> None:
    """Let docstrings be read as they are written.

    Bars are moduli (`|P/Z|`), not substitutions; a name in backticks may have anything after it;
    and what stands indented between two blank lines above the first section is a formula or a
    diagram.
    """
    text: list[str] = []
    prose = True
    literal = False
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if following and set(following) == {"-"}:
            prose = False  # the head of a numpydoc section
        indented = line.startswith("   ")
        after_blank = number > 0 and not lines[number - 1].strip()
        if prose and indented and after_blank and not literal:
            announced = next((t for t in reversed(text) if t.strip()), "").endswith("::")
            listed = next((t for t in reversed(text) if t.strip()), "").lstrip()[:2] in ("* ", "- ")
            if not announced and not listed:
                text += ["::", ""]
            literal = not listed
        elif line.strip() and not indented:
            literal = False
        text.append(line if literal else MARKUP.sub(as_read, line))
    lines[:] = text


def as_read(match: re.Match[str]) -> str:
    """Return the reStructuredText for a piece of markup as docstrings use it."""
    if match["bar"]:
        return r"\|"
    return rf"``{match['name']}``\ " if match["name"] else match[0]


def inherited(_app, _what, name: str, _obj, skip: bool, _options) -> bool | None:
    """Leave out what pydantic gives every section."""
    return True if name.startswith("model_") or skip else None


def plain_signature(_app, _what, _name, _obj, _options, signature, returns):
    """Let a signature be read as Python where a default is made anew for each object."""
    return (signature or "").replace("<factory>", "...") or None, returns


def mathml(node, display: str) -> str:
    """Return a formula as MathML, with the spaces that TeX sets around bars, slashes and functions.

    Browsers show MathML by themselves, without a network.
    """
    text = latex2mathml.converter.convert(node.astext(), display=display)
    text = ORDINARY.sub(r'<mo stretchy="false" lspace="0" rspace="0">\g<sign></mo>', text)
    text = AFTER_FUNCTION.sub(rf"\g<function>{THIN}", text)
    return BEFORE_FUNCTION.sub(rf"\g<before>{THIN}\g<function>", text)


def inline_formula(writer, node) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node, "inline"))
    raise SkipNode


def displayed_formula(writer, node) -> None:
    """Write a formula that has its own line."""
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    writer.body.append(f"{mathml(node, 'block')}</div>")
    raise SkipNode


def write_font(app, error: Exception | None) -> None:
    """Put the font of formulas beside the pages: STIX Two Math, the glyphs that formulas use.

    The font comes with the package `ziamath`, which is found and not imported.  It is under the SIL
    Open Font Licence, whose text stands beside it.
    """
    if error is not None or app.builder.format != "html":
        return
    found = importlib.util.find_spec("ziamath")
    source = Path(found.submodule_search_locations[0]) / "fonts" / "STIXTwoMath-Regular.ttf"
    folder = Path(app.outdir) / "_static" / "fonts"
    path = folder / "STIXTwoMath.woff"
    if path.exists() and path.stat().st_mtime > Path(__file__).stat().st_mtime:
        return
    options = subset.Options(
        flavor="woff", layout_features=["ssty", "kern", "mark", "mkmk", "ccmp"]
    )
    options.name_IDs = ["*"]  # the copyright and the licence stay in the font
    font = subset.load_font(str(source), options)
    chosen = subset.Subsetter(options)
    chosen.populate(unicodes=[code for low, high in GLYPHS for code in range(low, high + 1)])
    chosen.subset(font)
    folder.mkdir(parents=True, exist_ok=True)
    subset.save_font(font, str(path), options)


def setup(app) -> None:
    """Connect the docstring filter ahead of napoleon's (500 is the default priority)."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
    app.connect("autodoc-process-docstring", plain_text, priority=400)
    app.connect("autodoc-skip-member", inherited)
    app.connect("autodoc-process-signature", plain_signature)
    app.connect("source-read", fill)
    app.connect("env-get-outdated", outdated)
    app.connect("build-finished", write_font)
