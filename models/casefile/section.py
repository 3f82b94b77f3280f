"""Sections of a case file, and the sentences that pydantic's errors about them become.

A section is a frozen pydantic model that refuses unknown keys.  Its fields carry their own
ranges (`models.casefile.quantity`); checks between fields are its `_faults`, each with the path of
the field it is about, so that the message can name the line.

`describe` words the errors.  Paths are those of the case file: the tags that pydantic puts into the
path of a discriminated union are taken out again by walking the section classes along it.
"""

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from ..basics import InputError
from .messages import Path, line_of, message_line, suggestion
from .quantity import Quantity

TAGS = ("type", "method", "spectrum")  #: Fields that select a section among its alternatives.


class Section(BaseModel):
    """A frozen part of a case; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Groups of fields of which one is given: replacing one drops the others of its group."""

    forgets: ClassVar[bool] = True
    """Whether setting the tag of a section by its path drops the fields of the former kind."""

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise InputError(describe(error, type(self), source=type(self).__name__)) from error

    # Without this mark pydantic would call __init__ for nested sections too, and the error of
    # a nested section would arrive as one text without its paths.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def _faults(self) -> Iterable[tuple[str, str]]:
        """Return what is wrong between the fields, once each by itself is right; see `problems`."""
        return ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        found = tuple(self._faults())
        if found:
            raise problems(*found)
        return self


def problems(*found: tuple[str, str]) -> PydanticCustomError:
    """Return the error that a section's own check raises, of pairs of a field and a sentence.

    Names are those in the section, dotted for deeper ones, empty for the section itself.
    """
    message = "; ".join(text for _, text in found)
    return PydanticCustomError("stillhook", "{message}", {"message": message, "problems": found})


def describe(
    error: ValidationError,
    model: type[Section],
    *,
    source: str,
    lines: Mapping[Path, int] | None = None,
) -> str:
    """Return one line per error that pydantic raised of a section class, in the order of the file.

    The source is the name of the file, or of what takes its place; `lines` are those of each path,
    where known.
    """
    found: list[tuple[int, str]] = []
    for entry in error.errors(include_url=False):
        if entry["type"] == "default_factory_not_called":
            continue  # a default that follows from a field which is wrong itself
        path, owner = _walk(model, entry["loc"])
        for where, text in _sentences(entry, path, owner):
            line = line_of(where, lines)
            found.append((line, message_line(source, line, where, text)))
    found.sort(key=lambda pair: pair[0])
    return "\n".join(text for _, text in found)


def sections_of(annotation: Any) -> tuple[type[Section], ...]:
    """Return the section classes named in an annotation, however deep."""
    return tuple(dict.fromkeys(_sections(annotation)))


def discriminator(member: type[Section]) -> tuple[str, str] | None:
    """Return the key and the value that select a section among its alternatives."""
    for name in TAGS:
        field = member.model_fields.get(name)
        if field is not None and get_origin(field.annotation) is Literal:
            return name, str(get_args(field.annotation)[0])
    return None


def _sections(annotation: Any) -> Iterator[type[Section]]:
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
        return
    for argument in get_args(annotation):
        yield from _sections(argument)


def _walk(model: type[Section], loc: Sequence[str | int]) -> tuple[Path, type[Section] | None]:
    """Return the path without union tags, and the section that holds its last element."""
    path: list[str | int] = []
    members: tuple[type[Section], ...] = (model,)
    owner: type[Section] | None = model
    for item in loc:
        if item == "[key]":  # what is wrong is the key before it
            continue
        tagged = {tag[1]: member for member in members if (tag := discriminator(member))}
        if len(members) > 1 and item in tagged:
            members = (tagged[str(item)],)
            continue
        path.append(item)
        if isinstance(item, int):
            continue
        owner = members[0] if len(members) == 1 else None
        field = owner.model_fields.get(item) if owner is not None else None
        members = sections_of(field.annotation) if field is not None else ()
    return tuple(path), owner


def _sentences(entry: Any, path: Path, owner: type[Section] | None) -> Iterator[tuple[Path, str]]:
    kind, context = entry["type"], entry.get("ctx", {})
    got = _got(entry.get("input"))
    fields = owner.model_fields if owner is not None else {}
    key = next((part for part in reversed(path) if isinstance(part, str)), "")
    if kind == "stillhook":
        for name, text in context["problems"]:
            parts = [int(part) if part.isdigit() else part for part in name.split(".") if part]
            yield (*path, *parts), text
    elif isinstance(context.get("error"), InputError):
        yield path, str(context["error"])
    elif kind == "missing":
        yield path, f"is missing{_wanted(fields.get(key))}"
    elif kind in ("extra_forbidden", "invalid_key"):
        key = str(path[-1])
        yield (*path[:-1], key), f"unknown key; {suggestion(key, list(fields))}"
    elif kind == "literal_error":
        expected = context["expected"]
        yield path, f"must be {expected}, got {got}{_near(entry.get('input'), expected)}"
    elif kind == "union_tag_not_found":
        tag = str(context["discriminator"]).strip("'")
        yield (*path, tag), f"is missing; {_choices(fields.get(key))}"
    elif kind == "union_tag_invalid":
        tag = str(context["discriminator"]).strip("'")
        text = f"{_choices(fields.get(key))}, got {context['tag']!r}"
        yield (*path, tag), text + _near(context["tag"], context["expected_tags"])
    elif kind in ("too_short", "too_long"):
        bound = context.get("min_length", context.get("max_length"))
        side = "at least" if kind == "too_short" else "at most"
        noun = "entry" if bound == 1 else "entries"
        yield path, f"must have {side} {bound} {noun}, got {context['actual_length']}"
    elif kind in _PLAIN:
        yield path, _PLAIN[kind].format(got=got, **context)
    else:
        message = str(entry["msg"]).removeprefix("Value error, ")
        yield path, f"{message[:1].lower()}{message[1:]}, got {got}"


_SECTION = "must be a section with keys of its own, got {got}"
_PLAIN = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), _SECTION),
    **dict.fromkeys(("tuple_type", "list_type"), "must be a list, got {got}"),
    "string_type": "must be text, got {got}",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters, got {got}",
}


def _got(value: object) -> str:
    if isinstance(value, dict | list | tuple):
        noun = "a section" if isinstance(value, dict) else "a list"
        return f"{noun} with {len(value)} entr{'y' if len(value) == 1 else 'ies'}"
    if value is None:
        return "nothing"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _wanted(field: Any) -> str:
    if field is None:
        return ""
    for item in field.metadata:
        if isinstance(item, Quantity):
            return f"; it must be {item.wanted}"
    tags = [tag for member in sections_of(field.annotation) if (tag := discriminator(member))]
    return f"; its {tags[0][0]} {_choices(field)}" if len(tags) > 1 else ""


def _choices(field: Any) -> str:
    tags = [tag for member in sections_of(field.annotation) if (tag := discriminator(member))]
    values = [repr(value) for _, value in tags]
    if len(values) > 3:
        values = [", ".join(values[:-1]), values[-1]]
    return f"must be {' or '.join(values)}"


def _near(value: object, expected: str) -> str:
    known = [part.strip("' ") for part in expected.replace(" or ", ",").split(",")]
    near = difflib.get_close_matches(str(value), known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else ""
