"""JUnit XML, which CI systems show as a table of tests."""

from collections.abc import Sequence
from typing import Literal, NamedTuple
from xml.etree import ElementTree


class JUnitCase(NamedTuple):
    """One test; `lines` say why it did not pass, the first as its summary."""

    group: str  # the class of the test, such as a scenario
    name: str  # of the test in its group
    kind: Literal["passed", "failed", "error"]  # error: no result
    lines: Sequence[str] = ()  # empty only for a test that passed

    @staticmethod
    def document(cases: "Sequence[JUnitCase]", command: str) -> str:
        """Return the tests of a command, such as `cranectl validate`, as JUnit XML."""
        count = {kind: sum(case.kind == kind for case in cases) for kind in ("failed", "error")}
        totals = {"tests": str(len(cases)), "failures": str(count["failed"]), "errors": str(count["error"])}
        root = ElementTree.Element("testsuites", totals)
        suite = ElementTree.SubElement(root, "testsuite", {"name": command, **totals})
        for case in cases:
            element = ElementTree.SubElement(suite, "testcase", {"classname": case.group, "name": case.name})
            if case.kind != "passed":
                tag = "failure" if case.kind == "failed" else "error"
                message = _printable(case.lines[0].splitlines()[0])
                ElementTree.SubElement(element, tag, {"message": message}).text = _printable(
                    "\n".join(case.lines)
                )
        ElementTree.indent(root)
        text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
        return text.decode() + "\n"


def _printable(text: str) -> str:
    """Replace characters that XML does not allow."""
    return "".join(char if char in "\n\t" or ord(char) >= 0x20 else "?" for char in text)
