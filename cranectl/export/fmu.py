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

from cranectl.export.description import FmuVariable, build_description, model_description
from cranectl.support.children import answer_of_program
from cranectl.support.errors import InputError

TEMPLATES = Path(__file__).parent / "templates" / "fmi"
FOLDERS = {2: "linux64", 3: "x86_64-linux"}  # of the binary, by version of FMI
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
LETTERS = {"parameter": "p", "input": "i", "output": "o", "constant": "c"}
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
    """Return the content of an FMU.

    Parameters
    ----------
    model : Model
        What the FMU computes.
    fmi : int
        Version of FMI, 2 or 3.

    Returns
    -------
    bytes
        The archive; the same model gives the same bytes.

    Raises
    ------
    InputError
        On another machine than Linux on x86-64, or without a C compiler.
    """
    sources = model_sources(model, fmi)
    token = _token(model, fmi)
    kept = {} if model.objects else sources
    units = [name for name in sources if name.endswith(".c")]
    description = model_description(model, fmi, token, units if kept else ())
    texts = {"modelDescription.xml": description, **{f"sources/{name}": text for name, text in kept.items()}}
    if kept and fmi == 3:
        texts["sources/buildDescription.xml"] = build_description(model.name, units)
    binary = f"binaries/{FOLDERS[fmi]}/{model.name}.so"
    contents = {name: text.encode() for name, text in texts.items()}
    contents[binary] = _compiled(model, sources)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name, FIRST_DATE), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def model_sources(model: Model, fmi: int) -> dict[str, str]:
    """Return all C files of an FMU by name: those of the model, and those around it."""
    texts = {name: (TEMPLATES / name).read_text(encoding="utf-8") for name in ("instance.h", f"fmi{fmi}.c")}
    values = {
        "TITLE": model.title.replace("*/", "* /"),
        "TOKEN": _token(model, fmi),
        "PERIOD": repr(model.period),
        "FAILURE": model.failure,
        "VARIABLES": len(model.variables),
        "MEMORY": max(model.memory, 1),
    }
    header = filled((TEMPLATES / "model.h.txt").read_text(encoding="utf-8"), values)
    rows = [f"    {float(variable.start).hex()}, /* {variable.name} */" for variable in model.variables]
    names = ", ".join(json.dumps(variable.name) for variable in model.variables)
    kinds = "".join(LETTERS[variable.causality] for variable in model.variables)
    variables = [
        "#include <float.h>",
        "",
        '#include "model.h"',
        "",
        "const double model_starts[MODEL_VARIABLES] = {",
        *rows,
        "};",
    ]
    for bound, sign in (("lowest", "-"), ("highest", "")):
        numbers = [getattr(variable, bound) for variable in model.variables]
        texts_of = [f"{sign}DBL_MAX" if number is None else float(number).hex() for number in numbers]
        variables.append(f"const double model_{bound}[MODEL_VARIABLES] = {{{', '.join(texts_of)}}};")
    variables.append(f"const char *const model_names[MODEL_VARIABLES] = {{{names}}};")
    variables += [f"const char model_kinds[MODEL_VARIABLES] = {json.dumps(kinds)};", ""]
    return {"model.h": header, "variables.c": "\n".join(variables), **texts, **model.sources}


def filled(template: str, values: Mapping[str, object]) -> str:
    """Return a template in which `@KEY@` is replaced by the value of each key."""
    return re.sub(r"@(\w+?)@", lambda match: str(values[match[1]]), template)


def _token(model: Model, fmi: int) -> str:
    """Return the text by which a description and its binary know each other."""
    digest = hashlib.sha256(repr((fmi, *model)).encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _compiled(model: Model, sources: Mapping[str, str]) -> bytes:
    """Return the library of a model."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise InputError(
            f"an FMU is to be written on {platform.system()}, {platform.machine()}",
            allowed="Linux on x86-64, for which its binary is",
            remedy="export it on such a machine, or in a container",
        )
    return compile_library(model.name, {**sources, **model.objects})


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
        code, _, errors = answer_of_program(command, COMPILER_TIMEOUT)
        if code or not library.is_file():
            said = " ".join(errors.replace(f"{folder}/", "").split())[:400] or f"its exit status is {code}"
            raise InputError(
                f"{program} cannot compile the export: {said}",
                allowed="a C compiler with the headers of the C library",
                remedy="install them, for example with apt install gcc libc6-dev",
            )
        return library.read_bytes()
