"""Serve the viewer and the files that it opens from one origin on this machine."""

import functools
import mimetypes
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

HERE = Path(__file__).parent
MODULES = HERE / "node_modules"
STUDIO = MODULES / "@foxglove" / "studio-base" / "assets"

OLD_SUBPROTOCOL, NEW_SUBPROTOCOL = b"foxglove.websocket.v1", b"foxglove.sdk.v1"


@contextmanager
def serve(files: Path) -> Iterator[str]:
    """Serve the shell page, the viewer, and `files` under /files/; yield the origin."""
    roots = {"modules": MODULES, "studio": STUDIO, "files": files}
    server = _Server(("127.0.0.1", 0), functools.partial(_Handler, roots))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@functools.cache
def bundle() -> bytes:
    """Return the viewer's code for today's subprotocol, without its source map."""
    code = (STUDIO / "index.js").read_bytes()
    if OLD_SUBPROTOCOL not in code:
        raise RuntimeError(f"{STUDIO} does not ask for {OLD_SUBPROTOCOL.decode()}: another version of it?")
    code = code[: code.rfind(b"\n//# sourceMappingURL=data:")]
    return code.replace(OLD_SUBPROTOCOL, NEW_SUBPROTOCOL)


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore broken connections: the viewer aborts requests on purpose, to learn a file's size."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(self, roots: dict[str, Path], *args: Any) -> None:
        self.roots = roots
        super().__init__(*args)

    def do_GET(self) -> None:
        """Send the requested file, or the requested range of its bytes."""
        path = unquote(urlsplit(self.path).path)
        data = self._read("/shell.html" if path == "/" else path)
        if data is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        part = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        start, stop = (int(part[1]), min(int(part[2]) + 1, len(data))) if part else (0, len(data))
        self.send_response(HTTPStatus.PARTIAL_CONTENT if part else HTTPStatus.OK)
        kind = "text/html" if path == "/" else mimetypes.guess_type(path)[0]
        self.send_header("Content-Type", kind or "application/octet-stream")
        self.send_header("Content-Length", str(stop - start))
        self.send_header("Accept-Ranges", "bytes")
        if part:
            self.send_header("Content-Range", f"bytes {start}-{stop - 1}/{len(data)}")
        self.end_headers()
        self.wfile.write(data[start:stop])

    def log_message(self, *_: object) -> None:
        """Print nothing."""

    def _read(self, path: str) -> bytes | None:
        if path == "/shell.html":
            return (HERE / "shell.html").read_bytes()
        if path == "/studio/index.js":
            return bundle()
        root, _, name = path.lstrip("/").partition("/")
        if root not in self.roots:
            return None
        file = (self.roots[root] / name).resolve()
        inside = file.is_relative_to(self.roots[root].resolve())
        return file.read_bytes() if inside and file.is_file() else None
