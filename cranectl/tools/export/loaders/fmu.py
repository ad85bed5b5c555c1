"""Load FMUs for co-simulation, FMI 2.0 and 3.0, that have a binary for this machine.

FMPy unpacks the FMU and reads its description. The functions of the FMU are called by address. This process
never loads the binary to inspect it: a separate program tests it first. The child process of a run makes an
instance for that run.
"""

import ctypes
import re
import shlex
import stat
import weakref
import zipfile
from functools import cached_property
from io import BytesIO
from itertools import starmap
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.controllers import Controller, Logged, Nominal
from cranectl.loaders import ControllerFile, ask_declaration, directory_of, slug
from cranectl.support import Array, CompiledStep, ForeignCode, InputError
from cranectl.tools.export.loaders import fmi, fmu_step
from cranectl.tools.export.loaders.fmu_variables import Variables, variables_of

MAX_UNPACKED_BYTES = 2**30  # unpacked
_TELL = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_int64] * 3, ctypes.c_double)


class Fmu:
    """An unpacked FMU and, in the process of a run, its binary and instances."""

    def __init__(self, file: ControllerFile) -> None:
        """Read the FMU; raise InputError if it is not an FMU for co-simulation on this machine."""
        fmpy = _library()
        folder = _unpacked(file, fmpy)
        try:
            # Common tools write files that the schema forbids, so only the parts used here are checked.
            description = fmpy.read_model_description(str(folder), validate=False)
        except Exception as error:  # of many classes
            raise wrong(file, f"its description cannot be read: {' '.join(str(error).split())}") from None
        if description.fmiVersion not in ("2.0", "3.0"):
            raise wrong(
                file, f"it has version {description.fmiVersion} of FMI", remedy="export it as FMI 2.0 or 3.0"
            )
        if description.coSimulation is None:
            kind = "model exchange" if description.modelExchange else "scheduled execution"
            raise wrong(file, f"it is for {kind} only", remedy="export it for co-simulation")
        self.file, self.description, self.kind = file, description, description.coSimulation
        self.fmi = int(description.fmiVersion[0])
        # FMI 2 says linux64, FMI 3 x86_64-linux.
        platform = fmpy.platform if self.fmi == 2 else fmpy.platform_tuple
        identifier = self.kind.modelIdentifier or ""
        if not re.fullmatch(r"[A-Za-z_]\w*", identifier, flags=re.ASCII):
            raise wrong(file, f"its modelIdentifier is '{identifier}', which is no identifier of C")
        name = f"{identifier}{fmpy.sharedLibraryExtension}"
        self.binary = folder / "binaries" / platform / name
        if not self.binary.is_file():
            there = ", ".join(sorted(path.name for path in (folder / "binaries").glob("*"))) or "none at all"
            sources = ", and sources in C" if (folder / "sources").is_dir() else ""
            remedy = f"compile these for this machine: fmpy compile {shlex.quote(str(file.path))}"
            raise wrong(
                file,
                f"it has no binary binaries/{platform}/{name}, it has {there}{sources}",
                remedy if sources else "export it for this machine",
            )
        if not self.binary.resolve().is_relative_to(folder.resolve()):
            raise wrong(file, f"its binary binaries/{platform}/{name} lies outside of it")
        self.resources = folder / "resources"
        self.variables: Variables = variables_of(file, description)
        exchanged = (self.variables.input_references, self.variables.output_references)
        self._references = [np.array(references, dtype=np.uint32) for references in exchanged]
        self._tell = _TELL(self._failed)  # kept, since steps call it by address
        self._made = False  # whether this process has made an instance
        self._lost: set[int] = set()  # instances with a fatal error, whose functions must not be called

    def check_period(self, period: float) -> None:
        """Raise InputError unless `period` [s] is a whole number of the FMU's steps, if it declares a step.

        The preferred step counts only if the FMU cannot vary its step and its table has no `every`.
        """
        table, experiment = self.variables.table, self.description.defaultExperiment
        own = self.kind.fixedInternalStepSize
        can_vary = self.kind.canHandleVariableCommunicationStepSize or "every" in table.model_fields_set
        if experiment is not None and not own and not can_vary:
            own = experiment.stepSize
        try:
            step = float(own or 0.0)
        except ValueError:
            raise wrong(self.file, f"its step is '{own}'") from None
        if step > 0.0 and not (period > 0.5 * step and isclose(period / step, round(period / step))):
            every = max(round(step * table.every / period), 1)
            raise InputError(
                f"{self.file.reference} has steps of {step:g} s, its controller is given {period:g} s",
                allowed="one or more of its steps",
                remedy=f"every = {every} in {self.file.path.with_suffix('.toml')}, control periods in a step",
            )

    def model(self) -> fmi.Plain:
        """Return the description of the model that `fmi` needs."""
        return {
            "fmi": self.fmi,
            "name": "cranectl",
            "token": self.description.guid,
            "resources": str(self.resources),
            "references": self.variables.fixed_references,
            "values": [*(known.default for known in self.variables.parameters), *self.variables.constants],
        }

    def entry(self, parameters: Array) -> int:
        """Return the address of the step, which fails if no instance can be made for these parameters."""
        try:
            self._begin(parameters)
        except (OSError, ValueError) as error:
            fmi.say(f"{self.file.reference}: {error}")
        return CompiledStep.address_of(fmu_step.step)

    @cached_property
    def _functions(self) -> fmi.Functions:
        """Functions of the binary, loaded into this process; raises OSError or ValueError if that fails."""
        return fmi.functions(str(self.binary), self.fmi)

    def _begin(self, parameters: Array) -> None:
        """Make an instance that lives as long as the array `parameters`; raise OSError or ValueError."""
        if self._made and self.kind.canBeInstantiatedOnlyOncePerProcess:
            raise ValueError(
                "it can be instantiated only once in a process, of which run and validate take one for each "
                "run, campaign and live do not"
            )
        known, variables = self._functions, self.variables
        before = (*variables.sources, *variables.commands, *variables.factors)
        first = fmu_step.PARAMETERS.sources + len(before)
        instance = fmi.initialised(known, self.model(), parameters[first:])
        self._made = True
        called = (known["Set"], known["ExitInitializationMode"], known["DoStep"], known["Get"], self._tell)
        parameters[: fmu_step.PARAMETERS.fmi] = (
            instance,
            *map(fmi.address, called),
            *(references.ctypes.data for references in self._references),
        )
        weakref.finalize(parameters, self._free, instance).atexit = False

    def _failed(self, instance: int, function: int, status: int, time: float) -> int:
        """Report a failure; the compiled step calls this function."""
        if status >= fmi.FATAL:
            self._lost.add(instance)
        failure = fmi.failure(self.fmi, fmu_step.FUNCTIONS[function], status)
        fmi.say(f"{self.file.reference}: at {time:.6g} s its {failure}")
        return 0

    def _free(self, instance: int) -> None:
        if instance not in self._lost:
            with ForeignCode.environment_kept():
                self._functions["FreeInstance"](instance)


def open_fmu(file: ControllerFile) -> tuple[Controller, ControllerFile]:
    """Return the controller of an FMU; raise InputError if it is no FMU or cannot be initialised."""
    fmu = Fmu(file)
    try:
        ask_declaration(fmi.__file__, fmu.binary, fmu.model())
    except ValueError as error:
        tool = fmu.description.generationTool or "unnamed"
        needs = (
            f"; it says that it needs the tool that made it: {tool}" if fmu.kind.needsExecutionTool else ""
        )
        raise wrong(file, f"{error}{needs}") from None
    CompiledStep.address_of(fmu_step.step)  # compiled before any run
    variables, table = fmu.variables, fmu.variables.table
    commanded = [index for index in variables.commands if index != fmu_step.HELD]

    def prepare(nominal: Nominal) -> tuple[Array, Array]:
        fmu.check_period(nominal.period)
        inputs, outputs = len(variables.input_references), len(variables.output_references)
        values = [float(value) for value in nominal.parameters.values()]
        sources = (*variables.sources, *variables.commands, *variables.factors, *values, *variables.constants)
        parameters = fmu_step.PARAMETERS.array(
            fmi=fmu.fmi, period=nominal.period, inputs=inputs, outputs=outputs, sources=sources
        )
        return parameters, fmu_step.MEMORY.array(values=np.zeros(inputs + outputs))

    controller = Controller(
        name=table.name or slug(fmu.description.modelName or "") or slug(file.path.stem),
        title=table.title or fmu.description.description or fmu.description.modelName or file.path.name,
        step=Controller.called_by_address,
        prepare=prepare,
        command=table.command,
        follows=table.follows,
        measures=variables.measures,
        every=table.every,
        reads=(),
        parameters=variables.parameters,
        logged=tuple(starmap(Logged, enumerate(variables.logged, fmu_step.MEMORY.values + len(commanded)))),
        entry=lambda _, parameters: fmu.entry(parameters),
    )
    return controller, file


EXPORT = "export it again; other tools than cranectl say whether it is whole"


def wrong(file: ControllerFile, what: str, remedy: str = EXPORT) -> InputError:
    """Return the error for a file that cannot be run as an FMU."""
    return InputError(
        f"{file.reference}: {what}",
        allowed="an FMU for co-simulation, FMI 2.0 or 3.0, with a binary for this machine",
        remedy=remedy,
    )


def _library() -> Any:
    try:
        import fmpy
        import fmpy.model_description
    except ImportError as error:
        raise InputError(
            f"no reader of FMUs: {error}",
            allowed="controllers in .py and .so without it",
            remedy="pip install 'cranectl[fmi]' (FMPy)",
        ) from None
    return fmpy


def _unpacked(file: ControllerFile, fmpy: Any) -> Path:
    """Unpack the FMU and return its folder; raise InputError for entries that leave the folder."""
    whole, part, folder = (directory_of(file) / name for name in ("law.fmu", "part", "fmu"))
    if folder.is_dir():
        return folder
    try:
        with zipfile.ZipFile(BytesIO(file.content)) as archive:
            items = archive.infolist()
        for item in items:
            if ".." in Path(item.filename).parts:
                raise wrong(file, f"it would write outside of its directory: '{item.filename}'")
            if stat.S_ISLNK(item.external_attr >> 16):  # the mode, in archives from Unix
                raise wrong(file, f"it has a link: '{item.filename}'")
        if sum(item.file_size for item in items) > MAX_UNPACKED_BYTES:
            raise wrong(file, f"it has more than {MAX_UNPACKED_BYTES} bytes when it is unpacked")
        whole.write_bytes(file.content)
        fmpy.extract(whole, part)
        # Only now, since a folder of this name counts as whole.
        part.rename(folder)
    except InputError:
        raise
    except Exception as error:  # of many classes
        raise wrong(file, f"it cannot be unpacked: {error}") from None
    return folder
