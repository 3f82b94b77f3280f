"""How the documentation is built: `make docs`.

The pages beside this file are Markdown.  The reference in `api/` is written here on every build,
one page for each package with one `automodule` for each of its modules, so no list of modules
has to be kept by hand.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import latex2mathml.converter
from docutils.nodes import SkipNode

DOCS = Path(__file__).parent
ROOT = DOCS.parent
PACKAGES = ("stillhook", "models", "synth", "mpc")
# A literal, a role or a link, which stay; a name in backticks; a bar.
MARKUP = re.compile(r"``[^`]+``|:[\w:]+:`[^`]+`|`[^`]+`_+|`(?P<name>[^`]+)`|(?P<bar>\|)")

project = "Stillhook"
author = "The Stillhook contributors"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_math_renderer = "mathml"
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"Stillhook {release}"

myst_enable_extensions = ["amsmath", "dollarmath", "deflist"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_ivar = True  # a field that has its own docstring too is then described once
# Short names in annotations (`below`, `type`) that several classes have: nothing to link to.
suppress_warnings = ["ref.python"]


def write_reference() -> None:
    """Write `api/<package>.md` and `api/index.md`, touching only what has changed."""
    folder = DOCS / "api"
    folder.mkdir(exist_ok=True)
    pages = {"index": "# Reference\n\n" + directive("toctree", "\n".join(PACKAGES))}
    for package in PACKAGES:
        # The package's own page shows its docstring alone: what it re-exports is described
        # once, with the module that defines it.
        parts = [f"# `{package}`", directive(f"automodule:: {package}", ":no-members:", rst=True)]
        for path in sorted((ROOT / package).rglob("*.py")):
            if path.stem in ("__init__", "__main__"):
                continue
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            parts += [f"## `{name}`", directive(f"automodule:: {name}", rst=True)]
        pages[package] = "\n\n".join(parts)
    for stale in set(folder.glob("*.md")) - {folder / f"{name}.md" for name in pages}:
        stale.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text + "\n":
            path.write_text(text + "\n", encoding="utf-8")


def directive(name: str, body: str = "", *, rst: bool = False) -> str:
    """Return a MyST directive; docstrings are reStructuredText, so theirs is wrapped in one."""
    if not rst:
        return f"```{{{name}}}\n{body}\n```"
    indented = "".join(f"   {line}\n" for line in body.splitlines())
    return f"```{{eval-rst}}\n.. {name}\n{indented}```"


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


def inline_formula(writer, node) -> None:
    """Write a formula as MathML: browsers show it by themselves, without a network."""
    writer.body.append(latex2mathml.converter.convert(node.astext()))
    raise SkipNode


def displayed_formula(writer, node) -> None:
    """Write a formula that has its own line."""
    formula = latex2mathml.converter.convert(node.astext(), display="block")
    writer.body.append(writer.starttag(node, "div", CLASS="math", STYLE="overflow: auto hidden"))
    writer.body.append(f"{formula}</div>")
    raise SkipNode


def setup(app) -> None:
    """Connect the docstring filter ahead of napoleon's (500 is the default priority)."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
    app.connect("autodoc-process-docstring", plain_text, priority=400)


write_reference()
