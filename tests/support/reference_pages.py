"""The module `docs/reference/pages.py`, which stands beside the pages that it fills."""

import importlib.util
import sys
from pathlib import Path

_FILE = Path(__file__).parents[2] / "docs" / "reference" / "pages.py"
_SPEC = importlib.util.spec_from_file_location("pages", _FILE)
assert _SPEC is not None
assert _SPEC.loader is not None
pages = importlib.util.module_from_spec(_SPEC)
sys.modules["pages"] = pages  # its dataclasses look for their module there
_SPEC.loader.exec_module(pages)
