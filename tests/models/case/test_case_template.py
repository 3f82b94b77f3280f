"""The template that `stillhook new` writes, and the JSON Schema for editors."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import (
    Case,
    InputError,
    bundled_cases,
    case_schema,
    load_case,
    template_text,
    write_text_atomically,
)
from models.casefile import Quantity, read_yaml
from models.casefile.section import sections_of

NAMES = [name for name, _ in bundled_cases()]
CASES_FOLDER = Path(__file__).parents[3] / "models" / "cases"


class TestTemplate:
    def test_runs_as_it_is(self, tmp_path):
        path = write_text_atomically(tmp_path / "my.yaml", template_text())
        case = load_case(path)
        assert case.winch.motor.type == "ac"
        assert case.winch.drive.torque_continuous > case.static_torque_budget

    def test_explains_every_field_with_its_range(self):
        entries = template_entries()
        explained = {path: comment for path, _, comment in entries}
        fields = dict(quantities(Case))
        assert set(fields) <= set(explained)
        for path, quantity in fields.items():
            if quantity is not None:
                wanted = quantity.wanted[0].upper() + quantity.wanted[1:]
                assert wanted in explained[path], path

    def test_what_it_leaves_out_is_valid_too(self, tmp_path):
        case = load_case(write_text_atomically(tmp_path / "my.yaml", template_text()))
        changes: dict[str, object] = {}
        for path, text, _ in template_entries():
            data, _ = read_yaml(text, path)
            if data is not None and "drag." not in path and "motor." not in path:
                changes[path] = data
        assert len(changes) > 60
        refused = {"significant_period", "voltage", "current_continuous", "current_peak"}
        # Those of other spectra; the template's sea is a JONSWAP.
        fields = "wind_speed depth width table.omega table.density file record beyond parts"
        refused |= {f"sea.{name}" for name in fields.split()}
        whole = ("gains.", "payload.shape.", "sea.spreading.", "sea.table.")
        by_hook = {path: changes.pop(path) for path in list(changes) if in_other_form(path)}
        by_crane = {k: by_hook.pop(k) for k in list(by_hook) if k.startswith("vessel.crane.")}
        assert case.replace(by_hook).vessel.hook_point == (-30.0, 12.0, 20.0)
        by_crane |= {k: v for k, v in by_hook.items() if not k.startswith("vessel.hook.")}
        assert case.replace(by_crane).vessel.hook_point[2] > 25.0
        for path, value in changes.items():
            change = {path: value}
            if path.startswith(whole):
                parent = path.rpartition(".")[0]
                change = {
                    parent: {k.rpartition(".")[2]: v for k, v in changes.items() if parent in k}
                }
            if path.rpartition(".")[2] in refused or path in refused:
                with pytest.raises(InputError, match=r"is not for|DC motor only|no such file"):
                    case.replace(change)
            else:
                case.replace(change)


class TestSchema:
    @pytest.mark.parametrize("name", [*NAMES, "template"])
    def test_bundled_files_conform(self, name):
        validator = jsonschema.Draft202012Validator(case_schema())
        data, _ = read_yaml((CASES_FOLDER / f"{name}.yaml").read_text(), name)
        assert [error.message for error in validator.iter_errors(data)] == []
        assert [
            error.message for error in validator.iter_errors(Case.from_dict(data).to_dict())
        ] == []

    def test_is_a_schema_of_its_draft(self):
        schema = case_schema()
        assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
        jsonschema.Draft202012Validator.check_schema(schema)
        json.dumps(schema)

    @pytest.mark.parametrize(
        ("path", "value"),
        [
            ("rope.diameter", "44 kg"),
            ("rope.diameter", 44),
            ("rope.diametre", 0.044),
            ("payload.mass", -5),
            ("payload.mass", "50 mt"),
            ("rope.masses", "Auto"),
            ("rope.masses", 2.5),
            ("winch.motor.type", "hydraulic"),
            ("sea.spectrum", "jonswop"),
        ],
    )
    def test_refuses_what_the_models_refuse(self, path, value):
        validator = jsonschema.Draft202012Validator(case_schema())
        data, _ = read_yaml((CASES_FOLDER / "subsea-crane.yaml").read_text(), "crane")
        section = data
        *above, last = path.split(".")
        for key in above:
            section = section[key]
        section[last] = value
        assert list(validator.iter_errors(data))
        with pytest.raises(InputError):
            Case.from_dict(data)

    @given(st.sampled_from(["20 m2", "20 m^2", "20m**2", "1e3 cm2", " +.5 m2 ", "5. ft2"]))
    def test_accepts_the_spellings_that_the_parser_accepts(self, text):
        area = case_schema()["$defs"]["Payload"]["properties"]["area"]
        jsonschema.Draft202012Validator(area).validate(text)
        assert Quantity("area", 0.0, 1e4).read(text) > 0

    @pytest.mark.parametrize("text", ["0.2 mg/sqrt(Hz)", "1e-3 m/s^2/sqrt(Hz)"])
    def test_accepts_noise_densities(self, text):
        field = case_schema()["$defs"]["PayloadSensor"]["properties"]["acceleration_noise"]
        jsonschema.Draft202012Validator(field).validate(text)
        assert Quantity("acceleration noise", 0.0, 10.0).read(text) > 0

    def test_descriptions_carry_the_unit(self):
        rope = case_schema()["$defs"]["Rope"]["properties"]
        assert rope["diameter"]["description"] == "Nominal diameter. Must be in [0.005, 0.3] m."
        assert "Must be in [1e+08, 3e+11] Pa." in rope["modulus"]["description"]
        definitions = case_schema()["$defs"]
        for definition in definitions.values():
            for name, field in definition["properties"].items():
                target = definitions.get(field.get("$ref", "").rpartition("/")[2], {})
                assert "description" in field or "description" in target, name


def quantities(model, prefix=""):
    """Every field below a section by its dotted path, with its quantity if it has one."""
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        members = sections_of(field.annotation)
        found = quantity_in(field.annotation, field.metadata)
        if not members or path in ("winch.drum.layers", "sea.parts"):
            yield path, found
        else:
            for member in members:
                yield from quantities(member, f"{path}.")


def quantity_in(annotation, metadata=()):
    for item in (*metadata, *getattr(annotation, "__metadata__", ())):
        if isinstance(item, Quantity):
            return item
    for argument in get_args(annotation):
        found = quantity_in(argument)
        if found is not None:
            return found
    return None


def in_other_form(path):
    """Whether a field goes with the RAOs of a whole vessel; the template has one hook's."""
    name = path.split(".")[1] if path.startswith("vessel.") else ""
    return name in ("raos", "hook", "crane", "heading", "speed", "current")


def template_entries():
    """Path, value and comment of each field in the template, whether it is left out or not."""
    entries, stack, comment = [], [], []
    for line in template_text().splitlines():
        match = re.fullmatch(r"( *)(?:# )?([A-Za-z_0-9]+):(?: (.*))?", line)
        if match is None:
            comment = [*comment, line.strip().removeprefix("# ")] if line.strip() else []
            continue
        depth = len(match[1]) // 2
        stack = [*stack[:depth], match[2]]
        entries.append((".".join(stack), match[3] or "", " ".join(comment)))
        comment = []
    return entries
