"""Settings of the whole test run."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Before numpy and matplotlib are imported: figures need no screen, and two workers that each
# start a thread for every core only get in each other's way.
os.environ["MPLBACKEND"] = "Agg"
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

# The same examples in every run, and no deadline: the first call of a compiled model is slow.
settings.register_profile("stillhook", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("stillhook")


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Name the stored studies of the docs that are older than their code, after a whole run."""
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS or config.option.collectonly:
        return
    sys.path.insert(0, str(Path(__file__).parents[1] / "docs" / "make"))
    from stored import older_than_their_code

    found = older_than_their_code()
    if found:
        terminalreporter.section("stored studies older than their code (make studies)")
        for sentence in found:
            terminalreporter.write_line(sentence)
