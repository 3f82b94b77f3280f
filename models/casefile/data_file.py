"""Fields of a case file that name another file: `file: buoy.spec`, `raos: supply.re1`.

A path in a case file is meant relative to that file, and a case has to mean the same wherever it
is used from: when a case is read, such a path becomes absolute (`Case.from_dict(..., folder=)`,
which `load_case` passes).  Without a folder, as in `case.replace`, it is relative to the folder
that the program runs in.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from ..basics import InputError

FOLDER = "folder"  #: Key of the case file's folder in pydantic's validation context.


@dataclass(frozen=True)
class DataFile:
    """Metadata of an annotated text field that holds the path of an existing file."""

    names: Callable[[], Collection[str]] = tuple
    """Names that stand for bundled data instead of a file; they stay as they are."""
    what: str = "a file"
    """What is wanted, with its article, as in `a RAO file or the name of a bundled vessel`."""

    def read(self, value: object, folder: Path | None) -> str:
        """Return the name that stands in a field, or the absolute path.

        A relative one starts from the folder, or from the working directory if that is None.
        """
        if not isinstance(value, str | Path) or not str(value).strip():
            raise InputError(f"must be the path of {self.what}, got {value!r:.60}")
        text = str(value)
        if text in self.names():
            return text
        try:
            path = Path(folder or ".", Path(text).expanduser()).resolve()
            found, is_folder = path.exists(), path.is_dir()
        except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: no such ~user
            raise InputError(f"must be the path of {self.what}, got {text!r}: {error}") from None
        if is_folder:
            raise InputError(f"must be the path of {self.what}, got the folder {text!r}")
        if not found:
            known = ", ".join(self.names())
            hint = f"; bundled: {known}" if known else ""
            raise InputError(f"no such file: {text!r} (looked for {path}){hint}")
        return str(path)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Tell pydantic to validate with `read` alone."""
        del source, handler

        def validate(value: Any, info: ValidationInfo) -> str:
            context = info.context if isinstance(info.context, dict) else {}
            return self.read(value, context.get(FOLDER))

        return core_schema.with_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe the field to editors."""
        del schema, handler
        return {"type": "string", "minLength": 1}
