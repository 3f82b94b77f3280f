"""A page that is served for the tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pytest
from served_page import Served, serve, stop


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[Served]:
    """The page, started in a folder with a good case and a bad one."""
    if find_spec("nicegui") is None:
        pytest.skip("needs nicegui: run `make page`")
    from models.case import template_text

    folder = tmp_path_factory.mktemp("start")
    (folder / "mine.yaml").write_text(template_text(), encoding="utf-8")
    bad = template_text().replace("peak_period", "peak_perid")
    (folder / "bad.yaml").write_text(bad, encoding="utf-8")
    page = serve(folder)
    yield page
    stop(page)
