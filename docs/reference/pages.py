"""What is made of the code when the docs are built: names, fields of a case, fields of results.

The pages of this folder and the glossary are Markdown with examples and meanings.  Where one says

    ## `load_case`                          under "reference", signature and docstring go below
    ```{made} case-file                     the sections of a case file
    ```{made} fields synth.design.Design    the fields of a class, as its own comments say

`filled` puts the rest there.  Nothing private is looked at, and no list is kept by hand.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
import textwrap
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic_core import PydanticUndefined

from models.basics import KINDS
from models.case import Case
from models.casefile import Section
from models.casefile.quantity import Quantity
from models.casefile.section import TAGS, sections_of

HERE = Path(__file__).parent
#: The eight groups of public names, in reading order: files of this folder.
GROUPS = (
    "cases",
    "vessels-and-seas",
    "designs",
    "runs",
    "predictive",
    "studies",
    "sweeps",
    "handing-over",
)
#: What classes leave to their fields' names, or say in one breath with another field.
OWN_WORDS = {
    "BestPossible.terms": "How the question is put, in words.",
    "Clairvoyant.case": "The case.",
    "Clairvoyant.hook": "Heave of the hook (n,) [m].",
    "Clairvoyant.payload": "Motion of the load (n,) [m].",
    "Clairvoyant.haul": "Rope hauled in (n,) [m].",
    "Comparison.seeds": "Seeds of the seas.",
    "FailureModes.case": "The case.",
    "FailureModes.seeds": "Seeds of the seas.",
    "FailureModes.modes": "One for each failure, in the order of the table.",
    "LimitUse.name": "Name of the limit.",
    "LimitUse.unit": "SI unit of value and bound.",
    "Run.seed": "Seed of the sea and of the noise.",
    "Run.units": "Their SI units by name.",
    "SystemFacts.held": "The load with the drum held.",
    "SystemFacts.modes": "Axial modes of rope and load with the drum held, from the lowest.",
    "SystemFacts.rope": "The rope: stiffness, masses, weight.",
    "SystemFacts.waves": "The sea and the hook's motion in it.",
    "SystemFacts.winch": "The winch at rest, and how fast it can haul.",
}
LOWER = "lower-level"  #: What knows nothing of winches, below the public names.
NAME = re.compile(r"^## `(?P<name>[A-Za-z_.]+)`$", re.MULTILINE)
MADE = re.compile(r"^```\{made\} (?P<what>[a-z-]+)(?P<arguments>[^\n]*)\n```$", re.MULTILINE)


def filled(text: str) -> str:
    """Return the text of a page with what is made of the code."""
    makers: dict[str, Callable[..., str]] = {
        "names": overview,
        "case-file": case_file,
        "fields": lambda *names: "\n".join(field_list(name) for name in names),
        "columns": column_list,
    }
    text = NAME.sub(lambda m: f"{m[0]}\n\n{described(m['name'])}", text)
    return MADE.sub(lambda m: makers[m["what"]](*m["arguments"].split()), text)


# --- The public names


def names_on(page: str) -> list[str]:
    """Return the names that a page of this folder has a heading for."""
    return NAME.findall((HERE / f"{page}.md").read_text(encoding="utf-8"))


def named(name: str) -> Any:
    """Return what a name of a page stands for: of `stillhook`, or dotted."""
    module, _, last = (
        f"stillhook.{name}".rpartition(".") if "." not in name else name.rpartition(".")
    )
    return getattr(import_module(module), last)


def one_line(name: str) -> str:
    """Return the first line of a name's docstring."""
    return (inspect.getdoc(named(name)) or "").partition("\n")[0].replace("|", r"\|")


def described(name: str) -> str:
    """Return the directive that shows signature and docstring."""
    path = name if "." in name else f"stillhook.{name}"
    it = named(name)
    if not isinstance(it, type):
        return f"```{{eval-rst}}\n.. autofunction:: {path}\n```"
    kind = "autoexception" if issubclass(it, BaseException) else "autoclass"
    return f"```{{eval-rst}}\n.. {kind}:: {path}\n```"


def overview() -> str:
    """Return all groups, each with its names and their one lines."""
    parts = []
    for page in (*GROUPS, LOWER):
        text = (HERE / f"{page}.md").read_text(encoding="utf-8")
        parts += [f"## [{text.partition(chr(10))[0].removeprefix('# ')}]({page}.md)", ""]
        for name in names_on(page):
            anchor = name.replace(".", "").lower()
            shown = name if "." in name else f"sh.{name}"
            parts += [f"[`{shown}`]({page}.md#{anchor})", f": {one_line(name)}", ""]
    return "\n".join(parts)


# --- The case file


@dataclass(frozen=True, kw_only=True)
class CaseField:
    """A field of a case file, as its page tells it."""

    name: str
    wants: str  #: Type, unit and range.
    default: str  #: The value, or whether it may be left out.
    text: str  #: What it is.


def case_sections() -> Iterator[tuple[str, type[Section], tuple[CaseField, ...]]]:
    """Return every section of a case file: its path, its class, its fields.

    A path ends in the tag that selects the section, as `winch.motor (type: ac)`, where there
    are alternatives.
    """
    yield "", Case, tuple(_case_fields(Case))
    for name, field in Case.model_fields.items():
        yield from _below(name, field.annotation, ())


def _below(path: str, annotation: Any, above: tuple[type, ...]) -> Iterator[Any]:
    members = [m for m in sections_of(annotation) if m not in above]
    for member in members:
        tag = _tag(member) if len(members) > 1 else ""
        yield path + tag, member, tuple(_case_fields(member))
    inner: dict[tuple[str, Any], None] = {}
    for member in members:
        for name, field in member.model_fields.items():
            if sections_of(field.annotation):
                inner[name, field.annotation] = None
    for name, inside in inner:
        yield from _below(f"{path}.{name}", inside, (*above, *members))


def _tag(member: type[Section]) -> str:
    for name in TAGS:
        field = member.model_fields.get(name)
        if field is not None and get_origin(field.annotation) is Literal:
            return f" ({name}: {get_args(field.annotation)[0]})"
    return ""


def _case_fields(section: type[Section]) -> Iterator[CaseField]:
    for name, field in section.model_fields.items():
        yield CaseField(
            name=name,
            wants=_wants((*field.metadata, field.annotation)),
            default=_default(field),
            text=" ".join(str(field.description or "").split()),
        )


def _wants(parts: tuple[Any, ...]) -> str:
    """Return type, unit and range of an annotation, which stands last behind its metadata."""
    *metadata, annotation = parts
    quantity = next((item for item in metadata if isinstance(item, Quantity)), None)
    if quantity is not None:
        return _quantity(quantity)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if hasattr(annotation, "__metadata__"):
        return _wants((*annotation.__metadata__, annotation.__origin__))
    if origin in (Union, types.UnionType):
        inside = [a for a in arguments if a is not type(None)]
        if all(isinstance(a, type) and issubclass(a, Section) for a in inside):
            return "a section"
        return " or ".join(dict.fromkeys(_wants((a,)) for a in inside))
    if origin is Literal:
        words = [f"`{word}`" for word in arguments]
        return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
    if origin is tuple:
        inside = [a for a in arguments if a is not Ellipsis]
        many = "a list, each " if Ellipsis in arguments else f"a list of {len(inside)}, each "
        return many + _wants((inside[0],))
    if origin is dict:
        return "free keys, each with a text"
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return "a section"
    return {str: "a text", bool: "true or false", int: "a whole number"}[annotation]


def _quantity(quantity: Quantity) -> str:
    label = KINDS[quantity.kind].label
    word = f"`{quantity.word}` or " if quantity.word else ""
    if math.isinf(quantity.low) and math.isinf(quantity.high):
        return f"{word}{label}{f' [{quantity.shown_unit}]' if quantity.shown_unit else ''}"
    return f"{word}{label}, {quantity.range}"


def _default(field: Any) -> str:
    if field.default_factory is not None:
        return "follows from other fields"
    if field.default is PydanticUndefined:
        return "must be given"
    if isinstance(field.default, Section):
        return "may be left out"
    if field.default is None:
        return "may be left out"
    value = field.default
    return (
        f"default `{f'{value:.6g}' if isinstance(value, float) else value}`"
        if value != ""
        else ("may be left out")
    )


def case_file() -> str:
    """Return all sections and fields of a case file as Markdown."""
    parts: list[str] = []
    for path, section, fields in case_sections():
        about = " ".join((section.__doc__ or "").split())
        parts += [f"## `{path or 'at the top'}`", "", about, ""]
        for field in fields:
            told = f"`{field.name}` -- {field.wants}; {field.default}"
            parts += [told, f": {field.text}", ""]
    return "\n".join(parts)


# --- Fields of results


def field_list(path: str) -> str:
    """Return a class's fields and properties, as its own comments say, as Markdown."""
    parts = [f"### `{path.rpartition('.')[2]}`", "", _about(path), ""]
    for names, text in field_texts(path):
        parts += [", ".join(f"`{name}`" for name in names), f": {text}", ""]
    return "\n".join(parts)


def _about(path: str) -> str:
    return (inspect.getdoc(_class(path)) or "").partition("\n")[0]


def _class(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(import_module(module), name)


@cache
def field_texts(path: str) -> tuple[tuple[tuple[str, ...], str], ...]:
    """Return names of fields and what is said of them; fields under one comment go together.

    A field that nothing is said of has an empty text.
    """
    it = _class(path)
    source = textwrap.dedent(inspect.getsource(it))
    lines = source.splitlines()
    body = ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    found: list[tuple[list[str], str]] = []
    written = dict(_attributes(inspect.getdoc(it) or ""))
    for number, node in enumerate(body.body):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            name, before = node.target.id, body.body[number - 1] if number else None
            if name.startswith("_") or "ClassVar" in ast.dump(node.annotation):
                continue
            own = OWN_WORDS.get(f"{it.__name__}.{name}", "")
            text = (
                own
                or _comment(lines, node)
                or _docstring_after(body, number)
                or written.get(name, "")
            )
            follows = before is not None and before.end_lineno == node.lineno - 1
            below = not text and follows and isinstance(before, ast.AnnAssign)
            if found and (below or (text and found[-1][1] == text)):
                found[-1][0].append(name)
            else:
                found.append(([name], text))
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            decorators = {ast.unparse(d).rpartition(".")[2] for d in node.decorator_list}
            if decorators & {"property", "cached_property"}:
                told = (ast.get_docstring(node) or "").partition("\n\n")[0]
                found.append(([node.name], " ".join(told.split())))
    return tuple((tuple(names), text.replace("``", "`")) for names, text in found)


def _comment(lines: list[str], node: ast.AnnAssign) -> str:
    """Return the `#:` behind a field, or above it."""
    last = lines[(node.end_lineno or node.lineno) - 1]
    if "#: " in last:
        return last.partition("#: ")[2].strip()
    above: list[str] = []
    number = node.lineno - 2
    while number >= 0 and lines[number].lstrip().startswith("#: "):
        above.insert(0, lines[number].strip().removeprefix("#: "))
        number -= 1
    return " ".join(above)


def _docstring_after(body: ast.ClassDef, number: int) -> str:
    if number + 1 >= len(body.body):
        return ""
    after = body.body[number + 1]
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
        return " ".join(str(after.value.value).split())
    return ""


def _attributes(docstring: str) -> Iterator[tuple[str, str]]:
    """Return what the section of a docstring says of the fields: names and texts."""
    names: list[str] = []
    texts: list[str] = []
    _, _, section = docstring.partition("Attributes\n----------\n")
    for line in [*section.splitlines(), "end"]:
        if line.startswith("    "):
            texts.append(line.strip())
        elif line.strip():
            for name in names:
                yield name, " ".join(texts)
            names, texts = [n.strip() for n in line.partition(" : ")[0].split(",")], []


# --- Columns of tables


@cache
def columns_of_tables() -> dict[str, set[tuple[str, str]]]:
    """Return the columns that results' tables have in CSV and JSON, with headings and units."""
    found: dict[str, set[tuple[str, str]]] = {}
    from stillhook.text.table import columns

    folder = HERE.parents[1] / "stillhook"
    for path in sorted(folder.rglob("*.py")):
        if path.parts[-2] in ("text", "report"):
            continue  # a report writes its tables as words
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args):
                continue
            first = node.args[0]
            if not (isinstance(first, ast.Constant) and isinstance(first.value, str)):
                continue
            if node.func.id == "columns":
                for column in columns(first.value):
                    unit = column.unit or ("1" if column.write else "")
                    found.setdefault(column.name, set()).add((column.heading, unit))
            elif node.func.id == "Column":
                label = node.args[1] if len(node.args) > 1 else None
                told = label.value if isinstance(label, ast.Constant) else first.value
                found.setdefault(first.value, set()).add((str(told), ""))
    return found


def column_list() -> str:
    """Return the columns by name, with the headings that people see and their units."""
    parts = ["| column | heading | SI unit |", "| --- | --- | --- |"]
    for name, seen in sorted(columns_of_tables().items()):
        headings = ", ".join(sorted({h for h, _ in seen if h and h != name}))
        units = ", ".join(sorted({u for _, u in seen if u}))
        parts.append(f"| `{name}` | {headings} | {units} |".replace("  ", " "))
    return "\n".join(parts)
