"""A controller in single precision: its C has no doubles, and its loss is that of a simulated run."""

import re
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.support.errors import InputError
from cranectl.tools.export import single as single_module
from cranectl.tools.export.package import exported_files
from cranectl.tools.export.single import in_single_precision
from tests.tools.export.exported import COMPILERS, prepared, replayed
from tests.tools.export.test_controllers import EQUAL
from tests.tools.export.test_sample import LIMITS, SENSING


def test_numbers_types_and_functions_change_and_comments_do_not() -> None:
    text = "double a = 0x1.8p+1 * sin(b1) + 2.5e-3 * fabs(x[3]) / 1e5; int i = 3, sinus;"
    changed = "float a = 0x1.8p+1f * sinf(b1) + 2.5e-3f * fabsf(x[3]) / 1e5f; int i = 3, sinus;"
    assert in_single_precision(text) == changed
    assert in_single_precision("/* double 1.5 sin */ double") == "/* double 1.5 sin */ float"
    assert in_single_precision("isfinite(x) && 10 > k && .5") == "isfinite(x) && 10 > k && .5"


@pytest.mark.parametrize(
    ("name", "drive", "overrides"), [("lqr", "velocity", [*SENSING, *LIMITS]), ("pid", "force", [])]
)
def test_its_c_computes_with_floats_alone(
    name: str, drive: str, overrides: list[str], tmp_path: Path
) -> None:
    exported = prepared(name, drive, *overrides)
    texts = exported_files(exported, "cranectl design …", single=True)
    for file, text in texts.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    code = re.sub(r"/\*.*?\*/", "", texts[f"{exported.stem}.c"], flags=re.DOTALL)
    assert not re.search(r"\bdouble\b", code)
    for options in ("-O0", "-O2 -Wdouble-promotion -Wno-error"):
        assert replayed(tmp_path, exported.stem, COMPILERS[0], options) == f"1000 samples: {EQUAL}\n"
    loss = re.search(r"at most ([\d.]+) mm\b", texts["README.md"])
    assert loss is not None
    assert 1e-4 < float(loss[1]) < 0.2
    assert not any(file.startswith("cranectl_") for file in texts)  # cranectl has doubles


def test_a_loss_that_is_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    exported = prepared("lqr", "velocity")
    monkeypatch.setattr(single_module, "MAX_LOSS", 1e-9)
    with pytest.raises(InputError, match=r"lqr in single precision: .* the load is up to .* m away"):
        exported_files(exported, "", single=True)


def test_the_command_takes_it_for_c_code_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    common = ["design", "lqr", "--scenario", "fast-diagonal", "--real", "float"]
    assert main([*common, "--fmu", "a.fmu"]) == 2
    assert main([*common, "--export", "c"]) == 0
    assert "float memory[" in Path("c/main.c").read_text(encoding="utf-8")
