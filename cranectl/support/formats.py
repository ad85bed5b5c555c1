"""What a file is, by how it begins: to say so where another kind of file is needed."""

import re

_FORMATS = {
    b"PK\x03\x04": "a zip archive, such as an Excel workbook or an FMU",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"MATLAB ": "a MATLAB file",
    b"\x89HDF": "an HDF5 file, as MATLAB 7.3 writes too",
    b"\x93NUMPY": "a NumPy file",
    b"ARROW1": "an Arrow file",
    b"PAR1": "a Parquet file",
    b"\x89MCAP": "an MCAP log",
    b"#ROSBAG": "a ROS bag",
    b"SQLite format 3": "a database, as ROS 2 bags are",
    b"ULog": "a ULog",
    b"\x7fELF": "a compiled library or program",
    b"MZ": "a compiled library or program",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a picture",
    b"\x1f\x8b": "compressed with gzip",
    b"\x28\xb5\x2f\xfd": "compressed with Zstandard",
    b"\xff\xfe": "text in UTF-16",
    b"\xfe\xff": "text in UTF-16",
    b"{": "JSON",
}
_ROOTS = {
    b"mujoco": "an MJCF model of MuJoCo",
    b"robot": "a URDF model",
    b"sdf": "an SDF model",
    b"html": "an HTML page",
}
# The first element of an XML document, after a declaration, comments and a document type.
# Atomic groups: without them a long row of comments without an element would take for ever.
_XML = re.compile(
    rb"\s*+(?>(?><\?.*?\?>|<!--.*?-->|<!doctype[^>]*>)\s*+)*+<(?P<root>[a-z_][\w.-]*)", re.DOTALL | re.I
)
_LOOKED_AT = 4096  # bytes
MARK = "\ufeff"  # what Windows editors write before a text in UTF-8


def format_of(content: bytes) -> str:
    """Return what a file with this content is, as a phrase with its article; empty if that is not known."""
    content = content.removeprefix(MARK.encode())
    for begins, name in _FORMATS.items():
        if content.startswith(begins):
            return name
    root = _XML.match(content[:_LOOKED_AT])
    return _ROOTS.get(root["root"].lower(), "XML") if root else ""
