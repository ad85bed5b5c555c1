"""The files of an FMU that describe it in XML."""

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal, NamedTuple
from xml.sax.saxutils import quoteattr

from cranectl.signals import Signal

if TYPE_CHECKING:
    from cranectl.tools.export.fmu import Model

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
DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'


Causality = Literal["parameter", "input", "output", "constant"]


class FmuVariable(NamedTuple):
    """A variable of an FMU, a number; one that is `discrete` changes only from sample to sample."""

    name: str
    causality: Causality
    unit: str
    description: str
    start: float = 0.0  # outputs have none
    lowest: float | None = None
    highest: float | None = None
    discrete: bool = False

    @classmethod
    def of_signal(cls, name: str, causality: Causality, signal: Signal, start: float = 0.0) -> "FmuVariable":
        """Return the variable `name` with unit and description of a signal."""
        return cls(name, causality, signal.unit, signal.description, start)

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


def element(name: str, attributes: Mapping[str, object], content: Iterable[str] = ()) -> str:
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
    head = {
        "fmiVersion": f"{fmi}.0",
        "modelName": model.name,
        "guid" if fmi == 2 else "instantiationToken": token,
        "description": model.title,
        "generationTool": f"cranectl {version('cranectl')}",
        "variableNamingConvention": "structured",
    }
    kind = {
        "modelIdentifier": model.name,
        "canHandleVariableCommunicationStepSize": False,
        "fixedInternalStepSize": model.period if fmi == 3 else None,
    }
    described = [_variable(fmi, k, variable) for k, variable in enumerate(variables)]
    inner: list[str] = []
    if fmi == 2:
        inner += _group("SourceFiles", [element("File", {"name": name}) for name in sources])
        unknowns = [element("Unknown", {"index": k + 1}) for k in outputs]
        structure = [*_group("Outputs", unknowns), *_group("InitialUnknowns", unknowns)]
    else:
        time = {"causality": "independent", "variability": "continuous"}
        described.append(element("Float64", {"name": "time", "valueReference": len(variables), **time}))
        names = ("Output", "InitialUnknown")
        structure = [element(name, {"valueReference": k}) for name in names for k in outputs]
    parts = [
        element("CoSimulation", kind, inner),
        *_group("UnitDefinitions", map(_unit, units)),
        element("DefaultExperiment", {"startTime": 0.0, "stepSize": model.period}),
        element("ModelVariables", {}, described),
        element("ModelStructure", {}, structure),
    ]
    return DECLARATION + element("fmiModelDescription", head, parts) + "\n"


def _group(name: str, content: Iterable[str]) -> list[str]:
    """Return an element in a list, or an empty list if it would have no content."""
    elements = list(content)
    return [element(name, {}, elements)] if elements else []


def _unit(unit: str) -> str:
    exponents = base_unit(unit)
    return element("Unit", {"name": unit}, [] if exponents is None else [element("BaseUnit", exponents)])


def _variable(fmi: int, reference: int, variable: FmuVariable) -> str:
    """Return a variable as a version of FMI has it."""
    known = {"name": variable.name, "valueReference": reference, "description": variable.description}
    if fmi == 2:
        return element("ScalarVariable", known | variable.role, [element("Real", variable.numbers)])
    return element("Float64", known | variable.role | variable.numbers)


def build_description(name: str, sources: Sequence[str]) -> str:
    """Return `buildDescription.xml`, with which FMI 3.0 says how sources are compiled."""
    listed = [element("SourceFile", {"name": source}) for source in sources]
    files = element("SourceFileSet", {"language": "C99"}, listed)
    configuration = element("BuildConfiguration", {"modelIdentifier": name}, [files])
    return DECLARATION + element("fmiBuildDescription", {"fmiVersion": "3.0"}, [configuration])
