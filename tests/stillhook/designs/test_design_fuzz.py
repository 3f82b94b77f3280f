"""Design and structure files that nobody has written on purpose: an InputError or a design."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from designs import thesis_design
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from touched_files import touched

import stillhook as sh
from models.basics import InputError
from models.casefile import read_yaml
from stillhook.designs.design_file import design_text

HERE = Path(__file__).parent
TREES = {
    "design": read_yaml(design_text(thesis_design()), "design")[0],
    "gains of format 1": read_yaml((HERE / "format_1_gains.yaml").read_text(), "1")[0],
    "structure of format 1": read_yaml((HERE / "format_1_structure.yaml").read_text(), "1")[0],
}
ANY = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore::models.PhysicsWarning")
@pytest.mark.parametrize("name", TREES)
@ANY
@given(data=st.data())
def test_a_touched_file_is_a_design_or_refused(
    name: str, data: st.DataObject, tmp_path: Path
) -> None:
    text = io.StringIO()
    YAML(typ="safe", pure=True).dump(data.draw(touched(TREES[name])), text)
    path = tmp_path / "a.yaml"
    path.write_text(text.getvalue(), encoding="utf-8")
    found, said = None, ""
    try:
        found = sh.load_design(path)
    except InputError as error:
        said = str(error)
    assert isinstance(found, sh.Design) or str(path) in said


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(noise=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_anything_else_is_refused(noise: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(noise)
    with pytest.raises(InputError, match=r"a\.yaml"):
        sh.load_design(path)
