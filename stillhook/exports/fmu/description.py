"""What an FMU says of itself: `modelDescription.xml`, and the description for OSP beside it.

Variables with their units --> FMI 2.0, Open Simulation Platform (OSP-IS 1.0)
"""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as Xml

from models.basics import InputError

_OSP = "https://open-simulation-platform.com/OspModelDescription/1.0.0"
_TOOL = "Stillhook"

_BASE: Mapping[str, Mapping[str, int]] = {
    "1": {},
    "A": {"A": 1},
    "K": {"K": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "s": {"s": 1},
}
"""Exponents of the base units of each unit."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One variable of an FMU; those of a kind are numbered in the order in which they come."""

    name: str  #: Words with points between.
    meaning: str
    #: ``input``, ``output``, or ``local`` of a number that never changes and only describes.
    causality: str
    #: What it is at first; None if it follows from the inputs.
    start: float | int | str | None
    unit: str = "1"  #: Of a real number, SI.
    discrete: bool = False  #: Whether it changes at samples only.
    declared: str = ""  #: Name of the type of an integer, one of the description's.

    @property
    def kind(self) -> str:
        """Its type in FMI."""
        if isinstance(self.start, str):
            return "String"
        return "Integer" if isinstance(self.start, int) else "Real"


@dataclass(frozen=True, kw_only=True, eq=False)
class Description:
    """All that the two files tell but for the guid."""

    name: str  #: Identifier of C, and the file's name.
    text: str  #: What it is, in sentences.
    #: Inputs first, then what they make, then what describes it.
    variables: Sequence[Variable]
    step: float  #: Communication step that is best [s].
    #: Types of integers by name: what each number, from 0 on, means.
    types: Mapping[str, Sequence[tuple[str, str]]]

    def of_kind(self, kind: str) -> list[Variable]:
        """Return the variables of a kind in the order of their value references."""
        return [variable for variable in self.variables if variable.kind == kind]

    @property
    def units(self) -> list[str]:
        """The units that occur.

        Raises InputError if the base units of one are not known.
        """
        found = sorted({variable.unit for variable in self.of_kind("Real")})
        for unit in found:
            if unit not in _BASE:
                raise InputError(f"export: fmu: the base units of {unit!r} are not known")
        return found


def model_description(told: Description, guid: str, sources: Sequence[str]) -> str:
    """Return `modelDescription.xml` with a guid, and the names of the sources to be compiled."""
    root = Xml.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=told.name,
        guid=guid,
        description=told.text,
        generationTool=_TOOL,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    simulated = Xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=told.name,
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        maxOutputDerivativeOrder="0",
        canBeInstantiatedOnlyOncePerProcess="false",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    files = Xml.SubElement(simulated, "SourceFiles")
    for name in sources:
        Xml.SubElement(files, "File", name=name)
    _define_units(root, told.units)
    if told.types:
        _define_types(root, told.types)
    categories = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(categories, "Category", name="logStatusError")
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(told.step))
    listed = Xml.SubElement(root, "ModelVariables")
    count = {"Real": 0, "Integer": 0, "String": 0}
    for variable in told.variables:
        _describe(listed, variable, count[variable.kind])
        count[variable.kind] += 1
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = Xml.SubElement(structure, "Outputs")
    unknown = []
    for index, variable in enumerate(told.variables, 1):
        if variable.causality == "output":
            # At a communication point it is what the last step made: no input changes it.
            Xml.SubElement(outputs, "Unknown", index=str(index), dependencies="")
            unknown += [index] if variable.start is None else []
    if unknown:
        initial = Xml.SubElement(structure, "InitialUnknowns")
        for index in unknown:
            Xml.SubElement(initial, "Unknown", index=str(index))
    return _text(root)


def osp_description(told: Description) -> str:
    """Return `NAME_OspModelDescription.xml`: a group of variables for each first word of a name.

    Inputs and outputs of a word are two groups, since a group is connected to another as a whole.
    """
    root = Xml.Element("OspModelDescription", xmlns=_OSP, version="1.0")
    _define_units(root, told.units)
    groups: dict[str, list[Variable]] = {}
    for variable in told.of_kind("Real"):
        if variable.causality != "local":
            word = variable.name.split(".")[0]
            groups.setdefault(f"{word}_{variable.causality}", []).append(variable)
    listed = Xml.SubElement(root, "VariableGroups")
    for name, members in groups.items():
        group = Xml.SubElement(listed, "Generic", name=name)
        for variable in members:
            Xml.SubElement(group, "Variable", ref=variable.name, unit=_unit(variable.unit))
    return _text(root)


def guid_of(told: Description, sources: Mapping[str, str | bytes]) -> str:
    """Return the guid of a description and all sources: others for any other content."""
    digest = hashlib.sha256(model_description(told, "", sorted(sources)).encode())
    for name in sorted(sources):
        content = sources[name]
        digest.update(name.encode() + b"\0")
        digest.update(content.encode() if isinstance(content, str) else content)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _describe(parent: Xml.Element, variable: Variable, reference: int) -> None:
    constant = variable.causality == "local"
    still = variable.discrete or variable.kind != "Real"
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.meaning,
        "causality": variable.causality,
        "variability": "constant" if constant else "discrete" if still else "continuous",
    }
    if variable.causality != "input":
        attributes["initial"] = "calculated" if variable.start is None else "exact"
    listed = Xml.SubElement(parent, "ScalarVariable", attributes)
    typed: dict[str, Any] = {}
    if variable.declared:
        typed["declaredType"] = variable.declared
    if variable.start is not None:
        start = variable.start
        typed["start"] = start if isinstance(start, str) else repr(start)
    if variable.kind == "Real":
        typed["unit"] = _unit(variable.unit)
    Xml.SubElement(listed, variable.kind, typed)


def _define_units(root: Xml.Element, units: Sequence[str]) -> None:
    defined = Xml.SubElement(root, "UnitDefinitions")
    for unit in units:
        one = Xml.SubElement(defined, "Unit", name=_unit(unit))
        exponents = {name: str(power) for name, power in _BASE[unit].items()}
        Xml.SubElement(one, "BaseUnit", exponents)


def _define_types(root: Xml.Element, types: Mapping[str, Sequence[tuple[str, str]]]) -> None:
    """Write types of integers.

    They are no enumerations, of which some masters (libcosim among them) read no variable.
    """
    defined = Xml.SubElement(root, "TypeDefinitions")
    for name, values in types.items():
        said = "; ".join(f"{i} {value}: {text}" for i, (value, text) in enumerate(values))
        one = Xml.SubElement(defined, "SimpleType", name=name, description=said)
        Xml.SubElement(one, "Integer", min="0", max=str(len(values) - 1))


def _unit(name: str) -> str:
    return name.replace(" ", ".")


def _text(root: Xml.Element) -> str:
    Xml.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Xml.tostring(root, encoding="unicode")}\n'
