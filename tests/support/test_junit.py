"""JUnit XML has what the strictest schema of CI systems, that of Ant, requires, in its order."""

import re
from xml.etree import ElementTree

from cranectl.support import JUnitCase, Provenance

CASES = [
    JUnitCase("scenario", "lqr / ideal", "passed", seconds=1.25),
    JUnitCase("scenario", "pid / ideal", "failed", ["too far: \x00 5 m", "again: cranectl validate"], 0.5),
    JUnitCase("broken.toml", "", "error", ["no TOML"]),
]
# Attributes that the schema requires, by element.
REQUIRED = {
    "testsuite": {
        "id", "package", "name", "timestamp", "hostname", "tests", "failures", "errors", "time",
    },
    "property": {"name", "value"},
    "testcase": {"name", "classname", "time"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
}  # fmt: skip


def test_a_document_has_what_the_schema_requires() -> None:
    root = ElementTree.fromstring(JUnitCase.document(CASES, "cranectl validate", 2.0))
    assert root.tag == "testsuites"
    (suite,) = root
    assert [child.tag for child in suite] == ["properties", *["testcase"] * 3, "system-out", "system-err"]
    for element in root.iter():
        assert set(element.attrib) == REQUIRED.get(element.tag, set()), element.tag
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", suite.attrib["timestamp"])
    assert [suite.attrib[name] for name in ("tests", "failures", "errors", "time")] == [
        "3",
        "1",
        "1",
        "2.000",
    ]
    assert [case.attrib["time"] for case in suite.iter("testcase")] == ["1.250", "0.500", "0.000"]
    (failure,) = suite.iter("failure")
    assert (failure.attrib["message"], failure.text) == (
        "too far: ? 5 m",
        "too far: ? 5 m\nagain: cranectl validate",
    )


def test_its_properties_are_the_versions_of_this_program() -> None:
    root = ElementTree.fromstring(JUnitCase.document(CASES, "cranectl validate", 2.0))
    found = {element.attrib["name"]: element.attrib["value"] for element in root.iter("property")}
    assert found == Provenance.now()
    assert found.keys() >= {"cranectl", "sources", "mujoco"}
