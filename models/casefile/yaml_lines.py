"""YAML 1.2: reading with the line of each key, and writing.

ruamel.yaml's pure parser is used because it follows YAML 1.2, in which `1e6` is a number and `no`
is a word; PyYAML and the C parser follow 1.1, in which they are a text and False.  The file is
composed into nodes once: the nodes give the lines and the repeated keys, and the data.  Composing
ends at a limit of nodes and of depth: what is longer or deeper is no case, whatever it is.
"""

import io
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode
from typing_extensions import override

from ..basics import InputError, read_text
from .messages import Path, message_line

_DEEPEST = 20
"""Nesting at which reading stops: a case has five levels; an alias may refer to itself."""

_MOST = 100_000  #: Number of nodes at which reading stops: aliases of aliases grow without bound.

_LARGEST = 4_000_000  # bytes: more than so many nodes take


class _Composer(Composer):
    """Nodes of a text, up to the limits; an anchor that is set anew is no matter."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self.warn_double_anchors = False
        self._count = self._deep = 0

    @override
    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the next node, or raise a sentence without its source."""
        self._count += 1
        self._deep += 1
        if self._count > _MOST:
            raise _TooLongError(f"has more than {_MOST} entries; no case is that long")
        if self._deep > _DEEPEST + 1:
            raise _TooLongError(f"is nested deeper than {_DEEPEST} levels; no case is")
        node = super().compose_node(parent, index)
        self._deep -= 1
        return node


class _TooLongError(Exception):
    """A text that is too long or too deep."""


def case_text(path: str | FilePath) -> str:
    """Return the text of a case file, or of another file of sections.

    Raises InputError if it cannot be read, is no text, or is larger than such files are.
    """
    return read_text(path, _LARGEST)


def read_yaml(text: str, source: str) -> tuple[Any, dict[Path, int]]:
    """Return the contents of a YAML text, None if it holds nothing, and each path's line, from 1.

    Messages call the text by its source.

    Raises InputError if the text is not YAML, holds several documents or repeats keys.
    """
    parser, loader = YAML(typ="safe", pure=True), YAML(typ="safe", pure=True)
    parser.Composer = _Composer
    try:
        documents = list(parser.compose_all(text))
        if len(documents) > 1:
            raise InputError(f"{source}: must hold one YAML document, got {len(documents)}")
        if not documents:
            return None, {}
        lines: dict[Path, int] = {}
        repeated = []
        for path, node, again in _nodes(documents[0], (), source):
            line = node.start_mark.line + 1
            if again:
                text_ = f"is given twice, first in line {lines[path]}"
                repeated.append(message_line(source, line, path, text_))
            else:
                lines.setdefault(path, line)
            if len(lines) > _MOST:
                raise InputError(f"{source}: has more than {_MOST} entries; no case is that long")
        if repeated:
            raise InputError("\n".join(repeated))
        return loader.constructor.construct_document(documents[0]), lines
    except _TooLongError as error:
        raise InputError(f"{source}: {error}") from None
    except MarkedYAMLError as error:
        raise InputError(_sentence(error, source)) from error
    except (YAMLError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        first = str(error).partition("\n")[0].partition(";")[0]
        raise InputError(f"{source}: is not YAML: {first}") from error


def yaml_text(data: Mapping[str, Any]) -> str:
    """Return plain data as YAML: sections as blocks, lists of numbers on one line.

    From it `read_yaml` gives the same data, to the last digit.
    """
    writer = YAML(typ="rt", pure=True)
    writer.width = 100
    stream = io.StringIO()
    writer.dump(_styled(data), stream)
    return stream.getvalue()


def _styled(value: Any) -> Any:
    if isinstance(value, Mapping):
        return CommentedMap((key, _styled(item)) for key, item in value.items())
    if isinstance(value, list):
        sequence = CommentedSeq(_styled(item) for item in value)
        if not any(isinstance(item, dict | list) for item in value):
            sequence.fa.set_flow_style()
        return sequence
    return value


def _nodes(node: Node, path: Path, source: str) -> Iterator[tuple[Path, Node, bool]]:
    """Yield each path with the node whose line it has, and whether its key came before."""
    if len(path) > _DEEPEST:
        raise InputError(f"{source}: is nested deeper than {_DEEPEST} levels; no case is")
    if not path:
        yield path, node, False
    if isinstance(node, MappingNode):
        seen = set()
        for key, value in node.value:
            below = (*path, str(key.value))
            yield below, key, below in seen
            seen.add(below)
            yield from _nodes(value, below, source)
    elif isinstance(node, SequenceNode):
        for index, value in enumerate(node.value):
            yield (*path, index), value, False
            yield from _nodes(value, (*path, index), source)


def _sentence(error: MarkedYAMLError, source: str) -> str:
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark is not None else 0
    problem = str(error.problem or "cannot be understood").partition("\n")[0]
    if "'\\t'" in problem:
        text = "is indented with a tab; YAML wants spaces"
    else:
        text = f"is not YAML: {problem}"
    return message_line(source, line, (), text)
