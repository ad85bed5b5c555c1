"""FMUs in FMPy: instances that a test steps itself."""

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

HEADERS = Path(fmpy.__file__).parent / "c-code"


class Instance:
    """An instance of an FMU, by names of variables."""

    def __init__(
        self, path: Path, folder: Path, *, name: str = "one", start: float = 0.0, **values: float
    ) -> None:
        """Unpack an FMU into `folder`, and initialise an instance with `values` of variables."""
        described = fmpy.read_model_description(str(path))
        if not folder.exists():  # or it would be unpacked onto a library that is in use
            fmpy.extract(str(path), str(folder))
        self.references = {each.name: each.valueReference for each in described.modelVariables}
        self.is_second = described.fmiVersion == "2.0"
        kind = FMU2Slave if self.is_second else FMU3Slave
        self.slave = kind(
            guid=described.guid or described.instantiationToken,
            unzipDirectory=str(folder),
            modelIdentifier=described.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate()
        self.begin(start, **values)

    def begin(self, start: float = 0.0, **values: float) -> None:
        """Initialise the instance, which is new or has been reset."""
        self.time = start
        self.set(values)
        if self.is_second:
            self.slave.setupExperiment(startTime=start)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=start)
        self.slave.exitInitializationMode()

    def set(self, values: dict[str, float]) -> None:
        """Set variables."""
        references = [self.references[name] for name in values]
        numbers = [float(value) for value in values.values()]
        if references:
            (self.slave.setReal if self.is_second else self.slave.setFloat64)(references, numbers)

    def get(self, names: Iterable[str]) -> list[float]:
        """Return the values of variables."""
        references = [self.references[name] for name in names]
        return list((self.slave.getReal if self.is_second else self.slave.getFloat64)(references))

    def step(self, size: float, time: float | None = None) -> None:
        """Advance by `size` seconds, from `time` if it is given."""
        self.slave.doStep(self.time if time is None else time, size)
        self.time += size

    def close(self) -> None:
        """Free the instance."""
        self.slave.terminate()
        self.slave.freeInstance()


def symbols(library: Path, kind: str) -> set[str]:
    """Return the names of functions, without versions, that a library has `defined` or takes `undefined`."""
    command = ["nm", "-D", f"--{kind}-only", library]
    shown = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rows = [line.split()[-2:] for line in shown.splitlines()]
    return {name.partition("@")[0] for letter, name in rows if letter != "w"}


def standard_functions(fmi: int) -> set[str]:
    """Return the names of all functions that the standard requires of a library for co-simulation."""
    text = (HEADERS / f"fmi{fmi}Functions.h").read_text(encoding="utf-8")
    if fmi == 2:  # those for model exchange, which an FMU for co-simulation does not have
        kinds = [f"Functions for FMI2 for {kind}\n" for kind in ("Model Exchange", "Co-Simulation")]
        text = re.sub(".*?".join(kinds), "", text, flags=re.DOTALL)
    return set(re.findall(rf"^ *FMI{fmi}_Export\s+fmi{fmi}\w+TYPE\s+(fmi{fmi}\w+)\s*;", text, re.MULTILINE))
