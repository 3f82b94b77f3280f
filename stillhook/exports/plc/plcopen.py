"""A function block as PLCopen XML, which programming tools of controllers import.

The format is TC6 XML 2.01: `fileHeader`, `contentHeader`, `types` with the one `pou`, `instances`
without a configuration.  The body is the structured text as it stands in the ``.st`` file.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from .block import Block, Variable

NAMESPACE = "http://www.plcopen.org/xml/tc6_0201"
XHTML = "http://www.w3.org/1999/xhtml"

# A file tells when it was made; ours is the same whenever it is made.
_MADE = "2000-01-01T00:00:00"
_LISTS = {
    "VAR_INPUT": "inputVars",
    "VAR_OUTPUT": "outputVars",
    "VAR": "localVars",
    "VAR_TEMP": "tempVars",
}


def as_plcopen(block: Block) -> str:
    """Return a function block as a project of PLCopen XML."""
    project = ET.Element("project", {"xmlns": NAMESPACE})
    ET.SubElement(
        project,
        "fileHeader",
        {
            "companyName": "Stillhook",
            "productName": "Stillhook",
            "productVersion": "1",
            "creationDateTime": _MADE,
        },
    )
    content = ET.SubElement(project, "contentHeader", {"name": block.name})
    coordinates = ET.SubElement(content, "coordinateInfo")
    for language in ("fbd", "ld", "sfc"):
        scaled = ET.SubElement(coordinates, language)
        ET.SubElement(scaled, "scaling", {"x": "1", "y": "1"})
    types = ET.SubElement(project, "types")
    ET.SubElement(types, "dataTypes")
    pous = ET.SubElement(types, "pous")
    pou = ET.SubElement(pous, "pou", {"name": block.name, "pouType": "functionBlock"})
    interface = ET.SubElement(pou, "interface")
    for keyword, variables in block.sections():
        part = ET.SubElement(interface, _LISTS[keyword])
        for variable in variables:
            _declare(part, variable)
    _documented(interface, block.about)
    body = ET.SubElement(pou, "body")
    statements = ET.SubElement(ET.SubElement(body, "ST"), "xhtml", {"xmlns": XHTML})
    statements.text = block.body
    instances = ET.SubElement(project, "instances")
    ET.SubElement(instances, "configurations")
    _indent(project)
    text = ET.tostring(project, encoding="unicode", short_empty_elements=True)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def _declare(part: ET.Element, variable: Variable) -> None:
    declared = ET.SubElement(part, "variable", {"name": variable.name})
    kind = ET.SubElement(declared, "type")
    if variable.array:
        kind = ET.SubElement(kind, "array")
        upper = str(len(variable.initial) - 1)
        ET.SubElement(kind, "dimension", {"lower": "0", "upper": upper})
        kind = ET.SubElement(kind, "baseType")
    ET.SubElement(kind, variable.kind)
    if variable.initial:
        value = ET.SubElement(declared, "initialValue")
        if variable.array:
            values = ET.SubElement(value, "arrayValue")
            for each in variable.initial:
                one = ET.SubElement(values, "value")
                ET.SubElement(one, "simpleValue", {"value": each})
        else:
            ET.SubElement(value, "simpleValue", {"value": variable.initial[0]})
    if variable.comment:
        _documented(declared, variable.comment)


def _documented(of: ET.Element, comment: str) -> None:
    note = ET.SubElement(ET.SubElement(of, "documentation"), "xhtml", {"xmlns": XHTML})
    note.text = comment


def _indent(element: ET.Element, depth: int = 0) -> None:
    """Put elements on lines of their own; what has text keeps it as it is."""
    if len(element) == 0:
        return
    element.text = "\n" + "  " * (depth + 1)
    for child in element:
        _indent(child, depth + 1)
        child.tail = "\n" + "  " * (depth + 1)
    element[-1].tail = "\n" + "  " * depth
