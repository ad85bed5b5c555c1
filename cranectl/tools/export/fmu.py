"""Write an FMU for co-simulation, FMI 2.0 or 3.0: description, binary for Linux on x86-64, and sources."""

import hashlib
import json
import os
import platform
import re
import shlex
import shutil
import sys
import zipfile
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from uuid import UUID

from cranectl.support import InputError, Program
from cranectl.tools.export.description import FmuVariable, build_description, model_description

TEMPLATES = Path(__file__).parent / "templates"
FOLDERS = {2: "linux64", 3: "x86_64-linux"}  # of the binary, by version of FMI
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
INSTALL = "install one, for example with apt install gcc libc6-dev"
COMPILER_TIMEOUT = 600.0  # [s]
FIRST_DATE = (1980, 1, 1, 0, 0, 0)  # of all files, so that the same model gives the same bytes


class Model(NamedTuple):
    """A model behind the functions of FMI; the place of a variable is its value reference.

    `sources` are C files by name. They include `model.h` and define its two functions. `objects` are files of
    machine code by name, and an FMU with some of them has no sources.
    """

    name: str  # an identifier of C
    title: str
    variables: Sequence[FmuVariable]
    period: float  # of a sample [s]
    memory: int  # numbers of 8 bytes
    sources: Mapping[str, str]
    objects: Mapping[str, bytes] = {}
    failure: str = "a number is not finite"  # why it may not go on


def fmu_archive(model: Model, fmi: int = 2) -> bytes:
    """Return the content of an FMU for version 2 or 3 of FMI; the same model gives the same bytes.

    Raises InputError on another machine than Linux on x86-64, or without a C compiler.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise InputError(
            f"an FMU is to be written on {platform.system()}, {platform.machine()}",
            allowed="Linux on x86-64, for which its binary is",
            remedy="export it on such a machine, or in a container",
        )
    sources = model_sources(model, fmi)
    kept = {} if model.objects else sources
    units = [name for name in kept if name.endswith(".c")]
    texts = {"modelDescription.xml": model_description(model, fmi, _token(model, fmi), units)}
    texts |= {f"sources/{name}": text for name, text in kept.items()}
    if kept and fmi == 3:
        texts["sources/buildDescription.xml"] = build_description(model.name, units)
    contents = {name: text.encode() for name, text in texts.items()}
    library = compile_library(model.name, {**sources, **model.objects})
    contents[f"binaries/{FOLDERS[fmi]}/{model.name}.so"] = library
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name, FIRST_DATE), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def model_sources(model: Model, fmi: int) -> dict[str, str]:
    """Return all C files of an FMU by name: those of the model, and those around it."""
    variables = model.variables
    bounds = {
        key: ", ".join(f"{sign}DBL_MAX" if number is None else float(number).hex() for number in numbers)
        for key, sign, numbers in (
            ("LOWEST", "-", [variable.lowest for variable in variables]),
            ("HIGHEST", "", [variable.highest for variable in variables]),
        )
    }
    values = {
        "TITLE": model.title.replace("*/", "* /"),
        "TOKEN": _token(model, fmi),
        "PERIOD": repr(model.period),
        "FAILURE": model.failure,
        "VARIABLES": len(variables),
        "MEMORY": max(model.memory, 1),
        "STARTS": "\n".join(f"    {float(v.start).hex()}, /* {v.name} */" for v in variables),
        **bounds,
        "NAMES": ", ".join(json.dumps(variable.name) for variable in variables),
        "KINDS": json.dumps("".join(variable.causality[0] for variable in variables)),
    }
    texts = {name: filled(f"fmi/{name}.txt", values) for name in ("model.h", "variables.c")}
    texts |= {name: (TEMPLATES / "fmi" / name).read_text("utf-8") for name in ("instance.h", f"fmi{fmi}.c")}
    return {**texts, **model.sources}


def filled(template: str, values: Mapping[str, object]) -> str:
    """Return the text of a template in which `@KEY@` is replaced by the value of each key."""
    text = (TEMPLATES / template).read_text(encoding="utf-8")
    return re.sub(r"@(\w+?)@", lambda match: str(values[match[1]]), text)


def _token(model: Model, fmi: int) -> str:
    """Return the text by which a description and its binary know each other."""
    digest = hashlib.sha256(repr((fmi, *model)).encode()).hexdigest()
    return f"{{{UUID(digest[:32])}}}"


def compile_library(name: str, sources: Mapping[str, str | bytes]) -> bytes:
    """Return the shared library of C files and object files; raise InputError if it cannot be compiled."""
    program, *options = shlex.split(os.environ.get("CC") or "cc")
    compiler = shutil.which(program)
    if compiler is None:
        raise InputError(
            f"no C compiler: there is no program {program}",
            allowed="cc, or what the variable CC names",
            remedy="correct CC" if "CC" in os.environ else INSTALL,
        )
    with TemporaryDirectory(prefix="cranectl-library-") as directory:
        folder, library = Path(directory), Path(directory, f"{name}.so")
        for file, content in sources.items():
            (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
        units = [str(folder / file) for file in sources if not file.endswith(".h")]
        command = [compiler, *options, *FLAGS, "-o", str(library), *units, "-lm"]
        code, _, errors = Program.ask(command, COMPILER_TIMEOUT)
        if code or not library.is_file():
            said = " ".join(errors.replace(f"{folder}/", "").split())[:400] or f"its exit status is {code}"
            raise InputError(
                f"{program} cannot compile the export: {said}",
                allowed="a C compiler with the headers of the C library",
                remedy="install them, for example with apt install gcc libc6-dev",
            )
        return library.read_bytes()
