"""The hash of a case: that of its contents, and of nothing else."""

from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import math
import os
import pickle
import random
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import Case, InputError, bundled_cases, load_case, write_text_atomically

NAMES = [name for name, _ in bundled_cases()]
#: Fields, and what they may be: numbers, words and texts.
FIELDS = {
    "rope.length": st.floats(100.0, 1400.0),
    "payload.weight_uncertainty": st.floats(0.0, 0.5),
    "rope.damping_law": st.sampled_from(["kelvin-voigt", "hysteretic"]),
    "rope.sheaves": st.integers(0, 5),
    "limits.stroke": st.sampled_from([[-3.0, 0.0], [-3.0, -0.0], [-3.0, 1.0]]),
    "description": st.sampled_from(["a crane", "a crane in Norway: fjær, 5 µm, 重"]),
}


@pytest.fixture(scope="module")
def crane():
    return load_case("subsea-crane")


def shuffled(tree, rng):
    """Return plain data with the keys of every section in another order."""
    if not isinstance(tree, dict):
        return tree
    keys = list(tree)
    rng.shuffle(keys)
    return {key: shuffled(tree[key], rng) for key in keys}


def written(value) -> str:
    """Return plain data as canonical JSON, spelt out by hand."""
    if isinstance(value, dict):
        inside = (f"{json.dumps(key)}:{written(value[key])}" for key in sorted(value))
        return f"{{{','.join(inside)}}}"
    if isinstance(value, list):
        return f"[{','.join(map(written, value))}]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, float):
        return float.__repr__(abs(value) if value == 0.0 else value)
    assert type(value) is int
    return int.__repr__(value)


@pytest.mark.parametrize("name", NAMES)
def test_it_is_the_sha_256_of_the_canonical_contents(name):
    case = load_case(name)
    assert case.digest == hashlib.sha256(written(case.to_dict()).encode("ascii")).hexdigest()


def test_it_is_known_to_the_last_digit():
    """Another value here says that cases have another field, or that one means another thing."""
    case = load_case(Path(__file__).parents[2] / "golden" / "cases" / "thesis-1975.yaml")
    assert case.digest == "7c6413efc26513273ec7086a0773d97d7dc08d0a30fb0f3efdd394fae1bf19bb"


def test_cases_that_came_another_way_have_the_same(crane, tmp_path):
    file = write_text_atomically(tmp_path / "mine.yaml", crane.to_yaml())
    plain = write_text_atomically(tmp_path / "mine.json", json.dumps(crane.to_dict()))
    mixed = Case.from_dict(shuffled(crane.to_dict(), random.Random(3)), source="elsewhere")
    with_units = crane.replace({"rope.length": "1 km"})
    quiet = crane.variant({})
    for other in (load_case(file), load_case(plain), mixed, with_units, quiet, copy.copy(crane)):
        assert other.digest == crane.digest
    assert pickle.loads(pickle.dumps(crane)).digest == crane.digest


@pytest.mark.parametrize("seed", ["0", "1"])
def test_another_interpreter_has_the_same(crane, seed):
    code = "from models import load_case; print(load_case('subsea-crane').digest)"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONHASHSEED": seed, "LC_ALL": "C"},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        cwd=Path(__file__).parents[3],
    )
    assert run.stdout.strip() == crane.digest


CHANGES = st.fixed_dictionaries({}, optional=FIELDS)


@settings(max_examples=40)
@given(changes=CHANGES, others=CHANGES)
def test_it_is_equal_where_the_cases_are_and_only_there(changes, others):
    base = load_case("subsea-crane")
    one, other = base.variant(changes), base.variant(others)
    assert (one.digest == other.digest) == (one == other)
    if one == other:
        assert hash(one) == hash(other)
    again = Case.from_dict(json.loads(json.dumps(one.to_dict())))
    assert again.digest == one.digest


def numbers(tree, path=()):
    """Yield the path of every number of a case that is not a whole one."""
    if isinstance(tree, dict | list):
        for key, item in tree.items() if isinstance(tree, dict) else enumerate(tree):
            yield from numbers(item, (*path, str(key)))
    elif isinstance(tree, float):
        yield path


def test_the_last_bit_of_any_number_makes_another(crane):
    found = [crane.digest]
    for *path, last in numbers(crane.to_dict()):
        # Down by a bit, or up where a zero may not be less.
        for towards in (-math.inf, math.inf):
            changed = at = crane.to_dict()
            for key in path:
                at = at[key]
            at[last] = math.nextafter(at[last], towards)
            with contextlib.suppress(InputError):
                found.append(Case.from_dict(changed).digest)
                break
    assert len(set(found)) == len(found) > 80


def test_zeros_are_of_one_kind(crane):
    one, other = (crane.variant({"limits.stroke": [-3.0, zero]}) for zero in (0.0, -0.0))
    assert one == other
    assert one.digest == other.digest
    assert len({one, other}) == 1


def test_equal_cases_are_one_in_a_set_whatever_the_order_of_their_sources(crane):
    tree = crane.to_dict()
    tree["sources"] = dict(reversed(tree["sources"].items()))
    assert len({crane, Case.from_dict(tree)}) == 1


def data_files(model, path=()):
    """Return the paths of all fields below a model that name another file."""
    from pydantic import BaseModel

    from models.casefile import DataFile

    def parts(annotation):
        yield annotation
        for part in getattr(annotation, "__args__", ()):
            yield from parts(part)
        for part in getattr(annotation, "__metadata__", ()):
            yield part

    found = set()
    for name, field in model.model_fields.items():
        for part in (*parts(field.annotation), *field.metadata):
            if isinstance(part, DataFile):
                found.add((*path, name))
            elif isinstance(part, type) and issubclass(part, BaseModel):
                found |= data_files(part, (*path, name))
    return found


def test_every_field_that_names_a_file_counts_by_its_contents():
    from models.case.case import FILES

    assert data_files(Case) == {*FILES}


def test_a_file_counts_by_what_stands_in_it_and_not_by_where_it_lies(tmp_path, crane):
    header = "#YY MM DD hh mm .0500 .1000 .1500 .2000"
    swell = {"spectrum": "gaussian-swell", "significant_height": 1.0}
    swell |= {"peak_period": 14.0, "width": 0.05}
    digests: dict[str, list[str]] = {"alone": [], "in a sum": []}
    for folder, height in (("a", 4.0), ("b", 4.0), ("c", 4.1)):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "buoy.txt"
        path.write_text(f"{header}\n2020 01 01 00 00 0.1 {height} 1.0 0.3\n")
        measured = {"spectrum": "measured", "file": str(path), "beyond": "zero"}
        both = {"spectrum": "sum", "parts": [measured, swell]}
        for name, sea in (("alone", measured), ("in a sum", both)):
            digests[name].append(crane.replace({"sea": sea}).digest)
    for one, same, other in digests.values():
        assert one == same != other
