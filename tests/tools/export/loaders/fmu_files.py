"""FMUs of the law `damper` of `controller_files`, good and broken, for FMI 2.0 and 3.0."""

import platform
import subprocess
import zipfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import NamedTuple

import fmpy

HEADERS = Path(fmpy.__file__).parent / "c-code"
FOLDER = TemporaryDirectory(prefix="cranectl-fmu-")  # of binaries, as long as the tests run
# Its variables in the order of their value references.
INPUTS = [
    *(f"state.{drive}_{rate}" for drive in ("bridge", "trolley") for rate in ("position", "velocity")),
    *("state.rope_length", "state.rope_length_rate"),
    *(f"reference.load_{axis}{dot}" for dot in ("", "_dot") for axis in "xyz"),
]
OUTPUTS = ["command.bridge", "command.trolley", "command.rope", "error[1]"]
STARTS = {**dict.fromkeys(INPUTS, 'start="0"'), **dict.fromkeys(OUTPUTS, "")}
STARTS |= {"stiffness": 'start="16" min="0"', "damper.damping": 'start="8" min="0"'}
SOURCE = """
#include <stdio.h>
#include <stdlib.h>
#include "fmi%(fmi)sFunctions.h"
typedef struct { double v[18], sum; int steps; } Law;
static void step(Law *m) {
    double *q = m->v, *r = m->v + 6, *u = m->v + 12, *p = m->v + 16;
    m->steps++;
    BROKEN
    m->v[15] = r[0] - q[0];
    m->sum += m->v[15];
    for (int i = 0; i < 3; i++) {
        double target = i == 2 ? -r[2] : r[i], rate = i == 2 ? -r[5] : r[3 + i];
        u[i] = p[0] * (target - q[2 * i]);
        u[i] += p[1] * (rate - q[2 * i + 1]);
    }
}
static void *make(void) { MADE return calloc(1, sizeof(Law)); }
"""
FMI2 = """
static fmi2CallbackLogger log_;
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean log) {
    f->freeMemory(f->allocateMemory(1, 8));
    log_ = f->logger;
    SAID
    return make();
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d,
                               fmi2Real e) {
    return t == 0.0 ? fmi2OK : fmi2Error;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return INITIALISED; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean final) {
    if (t - ((Law *)c)->steps * h > 1e-9) return fmi2Error;
    step(c);
    if (((Law *)c)->steps > 1200) log_(0, "", fmi2Error, "", "no more, %s", "never");
    return ((Law *)c)->steps > 1200 ? AFTER : fmi2OK;
}
#define EXTRA
#define NAMED(name) fmi2##name
#define REAL(name) fmi2##name##Real
typedef fmi2ValueReference Reference;
"""
FMI3 = """
static fmi3LogMessageCallback say;
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean log,
    fmi3Boolean event, fmi3Boolean early, const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment e,
    fmi3LogMessageCallback told, fmi3IntermediateUpdateCallback update) {
    say = told;
    return make();
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 t,
                                       fmi3Boolean d, fmi3Float64 e) {
    say(0, fmi3Error, "", "not today");
    return t == 0.0 ? INITIALISED : fmi3Error;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean final, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    *event = *terminate = *early = fmi3False;
    *last = t + h;
    if (t - ((Law *)c)->steps * h > 1e-9) return fmi3Error;
    step(c);
    *terminate = ((Law *)c)->steps > 1200 && TERMINATED;
    return ((Law *)c)->steps > 1200 ? AFTER : fmi3OK;
}
#define EXTRA , size_t values
#define NAMED(name) fmi3##name
#define REAL(name) fmi3##name##Float64
typedef fmi3ValueReference Reference;
"""
BOTH = """
STATUS NAMED(ExitInitializationMode)(void *c) { return ((Law *)c)->v[4] > 0.1 ? 0 : 3; }
void NAMED(FreeInstance)(void *c) { FREED free(c); }
STATUS REAL(Set)(void *c, const Reference r[], size_t n, const double v[] EXTRA) {
    for (size_t i = 0; i < n; i++) ((Law *)c)->v[r[i]] = v[i];
    return 0;
}
STATUS REAL(Get)(void *c, const Reference r[], size_t n, double v[] EXTRA) {
    for (size_t i = 0; i < n; i++) v[i] = ((Law *)c)->v[r[i]];
    return 0;
}
"""


class Replaced(NamedTuple):
    """What is not as in the good one."""

    broken: str = ""  # statements of the step
    made: str = ""
    freed: str = ""
    said: str = ""  # statements of FMI 2's instantiate
    after: str = "0"  # status after 1200 steps
    initialised: str = "0"
    terminated: str = "0"


@cache
def binary(fmi: int, replaced: Replaced = Replaced()) -> Path:  # noqa: B008 - immutable
    """The library."""
    folder = Path(mkdtemp(dir=FOLDER.name))
    text = SOURCE % {"fmi": fmi} + (FMI2 if fmi == 2 else FMI3) + BOTH
    for name, value in {**replaced._asdict(), "status": f"fmi{fmi}Status"}.items():
        text = text.replace(name.upper(), value)
    (folder / "law.c").write_text(text)
    flags = ["-O2", "-w", "-shared", "-fPIC", "-ffp-contract=off", f"-I{HEADERS}"]
    subprocess.run(["cc", *flags, "-o", folder / "law.so", folder / "law.c"], check=True)
    return folder / "law.so"


def description(fmi: int, *, names: dict[str, str], variables: str = "", kind: str = "") -> str:
    """The XML: `names` replace those of variables, `variables` come after them, `kind` are attributes."""
    rows = []
    for k, (name, start) in enumerate(STARTS.items()):
        cause = "input" if name in INPUTS else "output" if name in OUTPUTS else "parameter"
        told = f'name="{names.get(name, name)}" valueReference="{k}" causality="{cause}"'
        told += ' variability="fixed"' if cause == "parameter" else ""
        real = f"<ScalarVariable {told}><Real {start}/></ScalarVariable>"
        rows.append(real if fmi == 2 else f"<Float64 {told} {start}/>")
    if fmi == 3:
        time = 'name="time" valueReference="99" causality="independent" variability="continuous"'
        rows.append(f"<Float64 {time}/>")
    outputs = range(len(INPUTS) + 1, len(INPUTS) + len(OUTPUTS) + 1)
    unknowns = "".join(f'<Unknown index="{k}"/>' for k in outputs)
    structure = "".join(f'<Output valueReference="{k - 1}"/>' for k in outputs)
    structure = f"<Outputs>{unknowns}</Outputs>" if fmi == 2 else structure
    version, token = ("2.0", "guid") if fmi == 2 else ("3.0", "instantiationToken")
    return (
        f'<fmiModelDescription fmiVersion="{version}" modelName="FmuDamper" {token}="x">'
        f'<CoSimulation modelIdentifier="law" {kind}/>'
        f"<ModelVariables>{''.join(rows)}{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def fmu(
    path: Path,
    fmi: int,
    *,
    xml: str = "",
    names: dict[str, str] | None = None,
    variables: str = "",
    kind: str = "",
    library: Path | None = None,
    more: Sequence[tuple[zipfile.ZipInfo | str, str]] = (),
) -> Path:
    """Written to `path`."""
    where = "linux64" if fmi == 2 else f"{platform.machine()}-linux"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            xml or description(fmi, names=names or {}, variables=variables, kind=kind),
        )
        archive.write(library or binary(fmi), f"binaries/{where}/law.so")
        for name, content in more:
            archive.writestr(name, content)
    return path
