"""What is open in a process is handed to its child processes, and nothing else tells them."""

import os
from math import inf
from pathlib import Path

from cranectl import open_controller
from cranectl.controllers.registry import ALL_CONTROLLERS, OPEN, OpenControllers, SharedControllers
from cranectl.loaders.opening import copy_of, open_again
from cranectl.support.children import Child
from cranectl.support.parent import Parent


def tell(parent: Parent, shared: SharedControllers) -> None:
    """In a child: open what is shared, and say what is open, and where copies lie."""
    open_again(shared)
    copies = [copy_of(file) for file in shared.files]
    parent.send((ALL_CONTROLLERS.digests(OPEN.files), copies))


def test_a_child_has_what_is_shared_and_copies_where_its_parent_removes_them(law: Path) -> None:
    names = [open_controller(f"{law}:damper"), open_controller(f"{law}:BridgeServo")]
    environment = dict(os.environ)
    child = Child.spawn(tell, OPEN.share(names[:1]))
    digests, copies = child.receive(inf)
    child.end()
    assert digests == ALL_CONTROLLERS.digests(names[:1])
    assert [path.parents[1] for path in copies] == [OPEN.folder]
    assert all(path.is_file() for path in copies)
    assert dict(os.environ) == environment


def test_a_process_makes_a_folder_of_its_own_where_its_parent_has_removed_that(tmp_path: Path) -> None:
    opened = OpenControllers()
    opened.take_folder(tmp_path / "removed")
    assert opened.folder.is_dir()
    assert opened.folder != tmp_path / "removed"
    opened.take_folder(None)
    assert opened.folder.is_dir()
