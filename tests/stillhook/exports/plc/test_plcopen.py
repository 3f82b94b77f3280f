"""PLCopen XML: the elements that TC6 2.01 asks for, in its order, and the same text."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import casadi as ca
import numpy as np
import pytest

from models.sensing import HEARD, Measurement, Recursion
from stillhook.exports.plc.block import Block, block_of
from stillhook.exports.plc.plcopen import NAMESPACE, XHTML, as_plcopen
from stillhook.exports.plc.syntax import units_in
from stillhook.exports.signals import SIGNALS

TC6, XML = f"{{{NAMESPACE}}}", f"{{{XHTML}}}"


def _block(kind: str = "LREAL") -> Block:
    x, m = ca.SX.sym("x", 2), ca.SX.sym("m", len(HEARD))
    on = m[HEARD.index("operator.enable")] > 0.5
    law = ca.if_else(ca.logic_and(on, x[0] < m[0]), x[1] * m[1], 1.5)
    function = ca.Function("f", [x, m], [ca.vertcat(x[1] + law, m[0]), ca.densify(law + law * law)])
    recursion = Recursion(function=function, initial=np.array([0.25, -3.0]))
    return block_of(recursion, "some_law", kind, about="a law", unit="V", rest=Measurement.of({}))


def _names(element: ET.Element) -> list[str]:
    return [child.tag.removeprefix(TC6) for child in element]


@pytest.mark.parametrize("kind", ["LREAL", "REAL"])
def test_the_elements_are_there_in_the_order_of_the_schema(kind: str) -> None:
    text = as_plcopen(_block(kind))
    assert text.startswith('<?xml version="1.0" encoding="utf-8"?>\n')
    project = ET.fromstring(text.encode())
    assert project.tag == f"{TC6}project"
    assert _names(project) == ["fileHeader", "contentHeader", "types", "instances"]
    header = {"companyName", "productName", "productVersion", "creationDateTime"}
    assert set(project[0].attrib) == header
    assert project[1].get("name") == "Stillhook_some_law"
    assert _names(project[1]) == ["coordinateInfo"]
    assert _names(project[1][0]) == ["fbd", "ld", "sfc"]
    for language in project[1][0]:
        assert _names(language) == ["scaling"]
        assert set(language[0].attrib) == {"x", "y"}
    assert _names(project[2]) == ["dataTypes", "pous"]
    assert _names(project[3]) == ["configurations"]
    (pou,) = project[2][1]
    assert pou.attrib == {"name": "Stillhook_some_law", "pouType": "functionBlock"}
    assert _names(pou) == ["interface", "body"]
    assert _names(pou[0]) == ["inputVars", "outputVars", "localVars", "tempVars", "documentation"]
    assert _names(pou[1]) == ["ST"]
    for part in pou[0][:4]:
        for variable in part:
            names = _names(variable)
            order = [n for n in ("type", "initialValue", "documentation") if n in names]
            assert names == order
            assert names[0] == "type"
            assert len(variable[0]) == 1


@pytest.mark.parametrize("kind", ["LREAL", "REAL"])
def test_it_declares_and_does_what_the_text_does(kind: str) -> None:
    block = _block(kind)
    pou = ET.fromstring(as_plcopen(block).encode())[2][1][0]
    body = pou.find(f"{TC6}body/{TC6}ST/{XML}xhtml")
    assert body is not None
    assert body.text == block.body
    assert f"\n{body.text}\nEND_FUNCTION_BLOCK\n" in block.text
    (unit,) = units_in(block.text)
    declared = [v for part in pou[0][:4] for v in part]
    assert [v.get("name", "").upper() for v in declared] == [v.name for v in unit.variables]
    kinds = []
    for variable in declared:
        array = variable.find(f"{TC6}type/{TC6}array")
        if array is not None:
            assert _names(array) == ["dimension", "baseType"]
            assert array[0].attrib == {"lower": "0", "upper": "1"}
            values = variable.findall(f"{TC6}initialValue/{TC6}arrayValue/{TC6}value/*")
            assert [v.get("value") for v in values] == ["0.25", "-3.0"]
            kinds.append(_names(array[1])[0])
        else:
            kinds.append(_names(variable[0])[0])
    assert kinds == [v.kind for v in unit.variables]
    first = pou[0][0][0].find(f"{TC6}initialValue/{TC6}simpleValue")
    assert first is not None
    assert first.get("value") == "0.0"
    note = pou[0][0][0].find(f"{TC6}documentation/{XML}xhtml")
    assert note is not None
    assert SIGNALS[0].meaning in str(note.text)
