"""Files that are cut, shuffled, damaged or noise: an InputError or a table, and soon."""

from __future__ import annotations

import io
import random
import re
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from vessel_tables import (
    DATA,
    aqwa_text,
    mss_vessel,
    orcaflex_text,
    shipx_text,
    swinging,
    wamit_listing_text,
    wamit_text,
)

from models.basics import InputError, PhysicsWarning
from models.vessel import VesselRaos
from models.vessel.readers import read_raos, write_raos
from models.vessel.readers.files import FORMATS

RAOS = swinging(6)
LONGEST = 5.0  # s a file, on a machine that is busy with other things
TOUCHY = ("1e308", "-1e308", "-1", "0", "nan", "inf", "99999999999", "1e-320", "x", "", "1_0", "[")


def samples(folder: Path) -> dict[str, bytes]:
    target = io.BytesIO()
    savemat(target, mss_vessel(RAOS))
    found = {
        "wamit": wamit_text(RAOS).encode(),
        "orcaflex": orcaflex_text(RAOS).encode(),
        "shipx": shipx_text({0.0: RAOS}).encode(),
        "mss": target.getvalue(),
        "aqwa": aqwa_text(RAOS).encode(),
        "wamit-listing": wamit_listing_text(RAOS).encode(),
        "csv": write_raos(folder / "a.csv", RAOS).read_bytes(),
        "netcdf": write_raos(folder / "a.nc", RAOS).read_bytes(),
    }
    barge = DATA / "mafredo" / "barge_100x30x4.nc"
    if barge.is_file():
        found["capytaine"] = barge.read_bytes()
    return found


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def damaged(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice([1, 3, 30, 300])):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def permuted(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    rng.shuffle(lines)
    return b"".join(lines)


def exchanged(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def holed(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data))
    return data[:start] + data[start + rng.randrange(1, 2000) :]


def stuttered(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data))
    return data[:start] + 3 * data[start : start + 400] + data[start + 400 :]


def renumbered(data: bytes, rng: random.Random) -> bytes:
    text = data.decode("latin-1")
    numbers = list(re.finditer(r"[-+]?\d[-+0-9.eE]*", text))
    if not numbers:
        return data
    chosen = rng.choice(numbers)
    return (text[: chosen.start()] + rng.choice(TOUCHY) + text[chosen.end() :]).encode("latin-1")


def headed_noise(data: bytes, rng: random.Random) -> bytes:
    return data[:200] + rng.randbytes(2000)


_TEXTS = ("csv", "wamit", "orcaflex", "shipx", "aqwa", "wamit-listing")
CHANGES = (cut, damaged, permuted, exchanged, holed, stuttered, renumbered, headed_noise)


def take(path: Path, kind: str | None) -> VesselRaos | None:
    """Read as a user would; None if it is refused as it should be."""
    found, said = None, ""
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", PhysicsWarning)
            found = read_raos(path, file_format=kind)
    except InputError as error:
        said = str(error)
    assert time.process_time() - start < LONGEST
    if found is None:
        assert str(path) in said
        return None
    assert np.all(np.isfinite(found.values))
    return found


@pytest.mark.ci
@pytest.mark.parametrize("change", CHANGES)
def test_a_damaged_file_of_any_format_is_refused_or_read(
    change: Callable[[bytes, random.Random], bytes], tmp_path: Path
) -> None:
    rng = random.Random(change.__name__)
    for kind, data in samples(tmp_path).items():
        for number in range(5):
            path = tmp_path / f"{kind}{number}.dat"
            path.write_bytes(change(data, rng))
            take(path, kind)
            take(path, None)


@given(noise=st.binary(max_size=400), kind=st.sampled_from([None, *FORMATS]))
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_random_bytes_are_no_rao_file(noise: bytes, kind: str | None, tmp_path: Path) -> None:
    path = tmp_path / "noise"
    path.write_bytes(noise)
    assert take(path, kind) is None


@given(text=st.text(max_size=300), kind=st.sampled_from(_TEXTS))
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_random_text_is_no_rao_file(text: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_text(text, encoding="utf-8", errors="replace")
    assert take(path, kind) is None


def test_a_file_of_one_format_is_not_read_as_another(tmp_path: Path) -> None:
    for kind, data in samples(tmp_path).items():
        path = tmp_path / f"{kind}.any"
        path.write_bytes(data)
        for other in FORMATS:
            if other != kind:
                assert take(path, other) is None


@pytest.mark.parametrize(
    "text",
    [
        "VesselTypes:\n" + "  - Name: [[[[[[" * 3000,
        "VesselTypes: &a [" + "*a, " * 2000 + "]",
        "VesselTypes:\n  - &x {Name: a}\n" + "  - *x\n" * 3000,
        "# " * 200_000 + "\n",
        "# name: " + "a" * 500_000 + "\nomega,heading,heave_real\n",
        "omega,heading," + "heave_real," * 5000 + "\n",
        " 1 " * 200_000,
    ],
)
def test_texts_that_would_make_a_reader_think_long_are_refused_soon(
    text: str, tmp_path: Path
) -> None:
    path = tmp_path / "slow.yml"
    path.write_text(text)
    for kind in (None, "orcaflex", "csv", "wamit"):
        assert take(path, kind) is None
