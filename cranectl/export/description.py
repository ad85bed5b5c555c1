"""The files of an FMU that describe it in XML."""

import re
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal, NamedTuple
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from cranectl.export.fmu import Model

# Exponents of kg, m, s and rad in a unit, and its factor to them.
BASE_UNITS = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Hz": {"s": -1},
}
POWERS = str.maketrans("²³⁴", "234")


class FmuVariable(NamedTuple):
    """A variable of an FMU, a number; one that is `discrete` changes only from sample to sample."""

    name: str
    causality: Literal["parameter", "input", "output", "constant"]
    unit: str
    description: str
    start: float = 0.0  # outputs have none
    lowest: float | None = None
    highest: float | None = None
    discrete: bool = False

    @property
    def role(self) -> dict[str, str]:
        """Causality, variability and initial as FMI names them."""
        changing = "discrete" if self.discrete else "continuous"
        return {
            "parameter": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
            "constant": {"causality": "local", "variability": "constant", "initial": "exact"},
            "input": {"causality": "input", "variability": changing},
            "output": {"causality": "output", "variability": changing, "initial": "calculated"},
        }[self.causality]

    @property
    def numbers(self) -> dict[str, object]:
        """Unit, start and bounds as FMI names them."""
        return {
            "unit": self.unit if self.unit not in ("", "1") else None,
            "min": self.lowest,
            "max": self.highest,
            "start": None if self.causality == "output" else float(self.start),
        }


def base_unit(unit: str) -> dict[str, int] | None:
    """Return the exponents of base units, such as {'m': 1, 's': -2}; None if a part is not known."""
    exponents: dict[str, int] = {}
    above, _, below = unit.translate(POWERS).partition("/")
    for sign, text in ((1, above), (-1, below)):
        for part in text.split():
            match = re.fullmatch(r"([A-Za-z]+)(\d?)", part)
            if match is None or match[1] not in BASE_UNITS:
                return None
            for name, exponent in BASE_UNITS[match[1]].items():
                exponents[name] = exponents.get(name, 0) + sign * exponent * int(match[2] or 1)
    return {name: exponent for name, exponent in exponents.items() if exponent}


def element(name: str, attributes: dict[str, object], content: Iterable[str] = ()) -> str:
    """Return an XML element; attributes that are None are left out."""
    texts = [f"{key}={quoteattr(_text(value))}" for key, value in attributes.items() if value is not None]
    head, inner = " ".join([name, *texts]), "\n".join(content)
    return f"<{head}>\n{inner}\n</{name}>" if inner else f"<{head}/>"


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)


def model_description(model: "Model", fmi: int, token: str, sources: Sequence[str]) -> str:
    """Return `modelDescription.xml`; `sources` are the C files to compile, if there are any."""
    variables = model.variables
    outputs = [k for k, variable in enumerate(variables) if variable.causality == "output"]
    units = dict.fromkeys(variable.unit for variable in variables if variable.numbers["unit"])
    head: dict[str, object] = {
        "fmiVersion": f"{fmi}.0",
        "modelName": model.name,
        "guid" if fmi == 2 else "instantiationToken": token,
        "description": model.title,
        "generationTool": f"cranectl {version('cranectl')}",
        "variableNamingConvention": "structured",
    }
    kind: dict[str, object] = {
        "modelIdentifier": model.name,
        "canHandleVariableCommunicationStepSize": False,
        "fixedInternalStepSize": model.period if fmi == 3 else None,
    }
    if fmi == 2:
        listed = [element("File", {"name": name}) for name in sources]
        inner = [element("SourceFiles", {}, listed)] if listed else []
        described = [_scalar(k, variable) for k, variable in enumerate(variables)]
        unknowns = [element("Unknown", {"index": k + 1}) for k in outputs]
        structure = [element(name, {}, unknowns) for name in ("Outputs", "InitialUnknowns") if unknowns]
    else:
        inner = []
        time = {"causality": "independent", "variability": "continuous"}
        described = [_float64(k, variable) for k, variable in enumerate(variables)]
        described.append(element("Float64", {"name": "time", "valueReference": len(variables), **time}))
        names = ("Output", "InitialUnknown")
        structure = [element(name, {"valueReference": k}) for name in names for k in outputs]
    parts = [
        element("CoSimulation", kind, inner),
        *([element("UnitDefinitions", {}, map(_unit, units))] if units else []),
        element("DefaultExperiment", {"startTime": 0.0, "stepSize": model.period}),
        element("ModelVariables", {}, described),
        element("ModelStructure", {}, structure),
    ]
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + element("fmiModelDescription", head, parts) + "\n"


def _unit(unit: str) -> str:
    exponents = base_unit(unit)
    return element("Unit", {"name": unit}, [] if exponents is None else [element("BaseUnit", {**exponents})])


def _scalar(reference: int, variable: FmuVariable) -> str:
    """Return a variable as FMI 2.0 has it."""
    known = {"name": variable.name, "valueReference": reference, "description": variable.description}
    return element("ScalarVariable", {**known, **variable.role}, [element("Real", {**variable.numbers})])


def _float64(reference: int, variable: FmuVariable) -> str:
    """Return a variable as FMI 3.0 has it."""
    known = {"name": variable.name, "valueReference": reference, "description": variable.description}
    return element("Float64", {**known, **variable.role, **variable.numbers})


def build_description(name: str, sources: Sequence[str]) -> str:
    """Return `buildDescription.xml`, with which FMI 3.0 says how sources are compiled."""
    listed = [element("SourceFile", {"name": source}) for source in sources]
    files = element("SourceFileSet", {"language": "C99"}, listed)
    configuration = element("BuildConfiguration", {"modelIdentifier": name}, [files])
    head: dict[str, object] = {"fmiVersion": "3.0"}
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + element("fmiBuildDescription", head, [configuration])
