"""Settings of the whole test run."""

from __future__ import annotations

import os

# Before numpy and matplotlib are imported: figures need no screen, and two workers that each
# start a thread for every core only get in each other's way.
os.environ["MPLBACKEND"] = "Agg"
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from hypothesis import settings  # noqa: E402

# The same examples in every run, and no deadline: the first call of a compiled model is slow.
settings.register_profile("stillhook", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("stillhook")
