"""The pages of the rooms have every name of every face, and each is explained."""

import inspect
import re

import pytest

from docs.api_pages import faces, room_pages

NAMES = [name for names in faces().values() for name in names]


def test_there_is_a_page_for_each_face() -> None:
    pages = dict(room_pages())
    assert set(pages) == {"index", *faces()}
    for name in NAMES:
        place = rf"^(\.\. [\w:]+:: .*\b|- ``){name.name}\b"
        assert re.search(place, pages[name.room], re.MULTILINE), name.name


@pytest.mark.parametrize("room", faces())
def test_each_name_of_a_face_is_explained(room: str) -> None:
    """By a docstring, or the comment beside a constant; so are all fields of a class."""
    unexplained = []
    for name in faces()[room]:
        if not name.summary:
            unexplained.append(name.name)
        if name.kind == "class" and "\nParameters\n---" not in (inspect.getdoc(name.value) or ""):
            unexplained += [f"{name.name}.{field}" for field, text in name.fields().items() if not text]
    assert unexplained == []
