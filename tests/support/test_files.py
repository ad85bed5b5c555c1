"""Files that are whole or not there."""

import os
import threading
from pathlib import Path

import pytest

from cranectl.support.errors import InputError, LogError
from cranectl.support.files import check_replaceable, replacing, write_text, writing


def test_a_file_appears_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with replacing(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail_half_way() -> None:
        with replacing(path) as part:
            part.write_text("ne")
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_pipe_is_written_to_but_never_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="no regular file"):
        check_replaceable(pipe)
    with pytest.raises(OSError, match="no regular file"), replacing(pipe):
        pass
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, "text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert pipe.is_fifo()


def test_a_missing_directory_is_made_when_checked(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.txt"
    check_replaceable(path)
    write_text(path, "text")
    assert path.read_text() == "text"


def test_threads_that_write_one_file_have_a_part_each(tmp_path: Path) -> None:
    """All hold theirs at once, and each in turn puts a whole file in place."""
    path, writers = tmp_path / "a.txt", 8
    ready, parts = threading.Barrier(writers, timeout=10.0), list[Path]()
    seen = list[str]()

    def write(text: str) -> None:
        with replacing(path) as part:
            parts.append(part)
            ready.wait()
            part.write_text(text)
            ready.wait()
            assert part.read_text() == text
        seen.append(path.read_text())

    texts = [f"{k}" * 1000 for k in range(writers)]
    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(parts)) == len(seen) == writers
    assert set(seen) <= set(texts)
    assert list(tmp_path.iterdir()) == [path]


def test_a_part_belongs_to_who_made_it(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with replacing(path) as first, replacing(path) as second:
        assert first.exists()
        assert first != second
        check_replaceable(path)
        assert sorted(tmp_path.iterdir()) == sorted([first, second])


@pytest.mark.parametrize("error", [InputError, LogError])
@pytest.mark.parametrize(
    ("name", "failure"), [("a", OSError("disk full")), ("a\0", ValueError("embedded null byte"))]
)
def test_what_cannot_be_written_is_bad_input(name: str, failure: Exception, error: type[InputError]) -> None:
    with pytest.raises(error, match=f"{failure}") as caught, writing(Path(name), remedy="x", error=error):
        raise failure
    assert caught.value.remedy == "x"


def test_other_errors_of_who_writes_stay_what_they_are(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such colour"), writing(tmp_path / "a"):
        raise ValueError("no such colour")
