"""The XML files of a functional mock-up unit: what it is, its variables, how to build it."""

import re
from typing import NamedTuple
from xml.etree import ElementTree

FMI_VERSION = "3.0"
TOOL = "Cellwright"
# Of each unit its base units of the SI; degC is an offset to K.
UNITS = {
    "s": {"s": "1"},
    "A": {"A": "1"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "degC": {"K": "1", "offset": "273.15"},
    "1": {},
}


class Variable(NamedTuple):
    """One variable of a unit, as modelDescription.xml states it.

    reference : number by which the C code knows it. causality : "input", "output", "parameter" or
    "independent". start : number, sequence of numbers (an array variable) or None. size : of an
    array variable, None of a scalar. minimum, maximum : of what may be set.
    """

    name: str
    reference: int
    causality: str
    unit: str
    description: str
    start: object = None
    size: int | None = None
    minimum: float | None = None
    maximum: float | None = None


CURRENT = Variable("current_ampere", 1, "input", "A", "Current, positive on charge", 0.0)
CELSIUS = "Temperature of the surroundings; of a cell without thermal constants its own"
STEP = "Longest internal step; a longer communication step is cut into equal ones"


def variables_of_cell(*, initial_soc, ambient_celsius, largest_step_second, cell_is_warm):
    """Variables of the unit of a cell.

    Parameters
    ----------
    initial_soc : [1]. ambient_celsius : [degC]. largest_step_second : [s].
    cell_is_warm : whether the cell has a temperature of its own.

    Returns
    -------
    variables : list of Variable.
    """
    own = "by its own heat" if cell_is_warm else "that of the surroundings"
    return [
        *_common(initial_soc, None, ambient_celsius, largest_step_second),
        Variable("voltage_volt", 5, "output", "V", "Terminal voltage"),
        Variable("soc", 6, "output", "1", "State of charge"),
        Variable("temperature_celsius", 9, "output", "degC", f"Temperature of the cell, {own}"),
    ]


def variables_of_pack(*, initial_soc, ambient_celsius, largest_step_second, cells):
    """Variables of the unit of a pack; arrays have one value a cell, in the order of the leaves.

    Parameters
    ----------
    initial_soc : (cells,) [1]. ambient_celsius : [degC]. largest_step_second : [s].
    cells : names of the cells.

    Returns
    -------
    variables : list of Variable.
    """
    size, order = len(cells), f"of {', '.join(cells)}"
    return [
        *_common(initial_soc, size, ambient_celsius, largest_step_second),
        Variable("voltage_volt", 5, "output", "V", "Voltage between the leads or at sense points"),
        Variable("soc_mean", 6, "output", "1", "Mean of the cells' states of charge"),
        Variable("soc_least", 7, "output", "1", "Least of the cells' states of charge"),
        Variable("soc_largest", 8, "output", "1", "Largest of the cells' states of charge"),
        Variable("temperature_celsius", 9, "output", "degC", "Temperature of the warmest cell"),
        Variable("cell_current_ampere", 10, "output", "A", f"Currents {order}", None, size),
        Variable("cell_voltage_volt", 11, "output", "V", f"Voltages {order}", None, size),
        Variable("cell_soc", 12, "output", "1", f"States of charge {order}", None, size),
        Variable(
            "cell_temperature_celsius", 13, "output", "degC", f"Temperatures {order}", None
        )._replace(size=size),
    ]


def _common(initial_soc, size, ambient_celsius, largest_step_second):
    return [
        Variable("time", 0, "independent", "s", "Simulation time"),
        CURRENT,
        Variable(
            "ambient_temperature_celsius", 2, "input", "degC", CELSIUS, ambient_celsius
        )._replace(minimum=-100.0, maximum=200.0),
        Variable(
            "initial_soc", 3, "parameter", "1", "State of charge at the start", initial_soc
        )._replace(size=size, minimum=0.0, maximum=1.0),
        Variable("largest_step_second", 4, "parameter", "s", STEP, largest_step_second)._replace(
            minimum=1e-6
        ),
    ]


def identifier_of(name):
    """A name as an identifier of the language C.

    Parameters
    ----------
    name : of a cell or pack.
    """
    return "cellwright_" + re.sub(r"[^A-Za-z0-9_]", "_", name)


def model_description(name, token, variables, *, description):
    """The file modelDescription.xml.

    Parameters
    ----------
    name : of the cell or pack. token : instantiation token. variables : list of Variable.
    description : one sentence.

    Returns
    -------
    text : bytes of XML.

    Source: FMI 3.0.2, Modelica Association 2024, section 2.4 and 4.4.
    """
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion=FMI_VERSION,
        modelName=name,
        instantiationToken=token,
        description=description,
        generationTool=TOOL,
        variableNamingConvention="flat",
    )
    ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier_of(name),
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
    )
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit, base in UNITS.items():
        ElementTree.SubElement(ElementTree.SubElement(units, "Unit", name=unit), "BaseUnit", base)
    categories = ElementTree.SubElement(root, "LogCategories")
    for category in ("error", "warning"):
        ElementTree.SubElement(categories, "Category", name=category)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="3600", stepSize="1")
    listed = ElementTree.SubElement(root, "ModelVariables")
    for variable in variables:
        _add_variable(listed, variable)
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = [str(v.reference) for v in variables if v.causality == "output"]
    for element in ("Output", "InitialUnknown"):
        for reference in outputs:
            ElementTree.SubElement(structure, element, valueReference=reference)
    return _xml(root)


def _add_variable(parent, variable):
    variability = {"parameter": "fixed"}.get(variable.causality, "continuous")
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "causality": variable.causality,
        "variability": "tunable" if variable.name == "largest_step_second" else variability,
        "unit": variable.unit,
        "description": variable.description,
    }
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    if variable.causality == "output":
        attributes["initial"] = "calculated"
    for key, value in (("min", variable.minimum), ("max", variable.maximum)):
        attributes |= {} if value is None else {key: repr(float(value))}
    if variable.start is not None:
        numbers = [variable.start] if variable.size is None else variable.start
        attributes["start"] = " ".join(repr(float(number)) for number in numbers)
    element = ElementTree.SubElement(parent, "Float64", attributes)
    if variable.size is not None:
        ElementTree.SubElement(element, "Dimension", start=str(variable.size))


def build_description(name, sources):
    """The file sources/buildDescription.xml.

    Parameters
    ----------
    name : of the cell or pack. sources : names of the C files.

    Returns
    -------
    text : bytes of XML.
    """
    root = ElementTree.Element("fmiBuildDescription", fmiVersion=FMI_VERSION)
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier_of(name))
    files = ElementTree.SubElement(build, "SourceFileSet", language="C11")
    for source in sources:
        ElementTree.SubElement(files, "SourceFile", name=source)
    ElementTree.SubElement(build, "Library", name="m", external="true")
    return _xml(root)


def _xml(root):
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
