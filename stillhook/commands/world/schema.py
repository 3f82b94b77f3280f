"""`stillhook schema`: the JSON Schema of a case file, for editors."""

import argparse
import json

from ...text import Report, write_json
from ..declare import options
from ..working import conclude
from .new import written

ARGUMENTS = (options("[file]  the file to write (default: standard output)"),)
EXAMPLES = (
    ("stillhook schema", "the schema on standard output"),
    ("stillhook schema case.schema.json", "or in a file, that an editor checks case files by"),
)


def run(arguments: argparse.Namespace) -> int:
    """Write the schema; return 0."""
    from models import case_schema

    text = json.dumps(case_schema(), indent=2, ensure_ascii=False) + "\n"
    if arguments.file is None:
        write_json(text)  # not through rich, which would break its long lines
        return 0
    path = written(arguments, text)
    status = f"begin a case file with `# yaml-language-server: $schema={path}`"
    return conclude(Report(name=str(path), status=status), arguments)
