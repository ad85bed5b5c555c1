"""JUnit XML, which CI systems show as a table of tests."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Literal, NamedTuple
from xml.etree import ElementTree

from cranectl.support.provenance import Provenance


class JUnitCase(NamedTuple):
    """One test; `lines` say why it did not pass, the first as its summary."""

    group: str  # the class of the test, such as a scenario
    name: str  # of the test in its group
    kind: Literal["passed", "failed", "error"]  # error: no result
    lines: Sequence[str] = ()  # empty only for a test that passed
    seconds: float = 0.0  # that it took; 0 if it was judged from results that were there

    @staticmethod
    def document(cases: "Sequence[JUnitCase]", command: str, seconds: float) -> str:
        """Return the tests of a command, such as `cranectl validate`, which took `seconds`, as JUnit XML.

        It has all that the schema of Ant requires, the strictest of those that CI systems use, and the
        versions and digests of this program as properties.
        """
        count = {kind: sum(case.kind == kind for case in cases) for kind in ("failed", "error")}
        totals = {"tests": str(len(cases)), "failures": str(count["failed"]), "errors": str(count["error"])}
        root, now = ElementTree.Element("testsuites"), datetime.now(UTC).replace(tzinfo=None)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            {
                "id": "0",
                "package": "cranectl",
                "name": command,
                "timestamp": now.isoformat(timespec="seconds"),  # in UTC; the schema allows no zone
                "hostname": "localhost",  # required; the name of the machine does not belong into results
                "time": f"{seconds:.3f}",
                **totals,
            },
        )
        properties = ElementTree.SubElement(suite, "properties")
        for name, value in Provenance.now().items():
            ElementTree.SubElement(properties, "property", {"name": name, "value": value})
        for case in cases:
            named = {"classname": case.group, "name": case.name, "time": f"{case.seconds:.3f}"}
            element = ElementTree.SubElement(suite, "testcase", named)
            if case.kind != "passed":
                tag = "failure" if case.kind == "failed" else "error"
                message = _printable(case.lines[0].splitlines()[0])
                ElementTree.SubElement(
                    element, tag, {"type": case.kind, "message": message}
                ).text = _printable("\n".join(case.lines))
        for stream in ("system-out", "system-err"):  # empty: all is in the failures
            ElementTree.SubElement(suite, stream)
        ElementTree.indent(root)
        text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
        return text.decode() + "\n"


def _printable(text: str) -> str:
    """Replace characters that XML does not allow."""
    return "".join(char if char in "\n\t" or ord(char) >= 0x20 else "?" for char in text)
