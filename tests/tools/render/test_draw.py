"""`cranectl render`: files that other programs read, and refusals before anything is drawn."""

import shutil
import sys
from pathlib import Path

import av
import numpy as np
import pytest
from av.video.reformatter import ColorRange, Colorspace
from PIL import Image, ImageSequence

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.support.colours import Palette
from cranectl.tools.render.draw import draw_runs, render_settings, write_mp4

SHORT = ["--set", "duration=0.6", "--set", "disturbances.0.start=0.1", "--set", "disturbances.1.start=0.2"]
SMALL = ["--size", "400x300"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    assert main(["run", "fixed-position", *SHORT, "--out", str(path)]) == 0
    return path


@pytest.fixture(autouse=True)
def in_directory_of_the_log(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(log, "run.mcap")


def colours(picture: Image.Image) -> np.ndarray:
    return np.asarray(picture.convert("RGB")).astype(float)


def test_a_png_is_the_same_each_time_and_shows_the_largest_error(capsys: pytest.CaptureFixture[str]) -> None:
    run = read_log("run.mcap")["mujoco"]
    worst = run.time[np.argmax(np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1))]
    for name, *time in (("a.png",), ("b.png", "--time", f"{worst:g}"), ("other.png", "--time", "0.1")):
        assert main(["render", "run.mcap", name, *SMALL, *time]) == 0
    assert f"picture at {worst:g} s: a.png" in capsys.readouterr().out
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes() != Path("other.png").read_bytes()
    with Image.open("a.png") as picture:
        assert (picture.format, picture.size, picture.mode) == ("PNG", (400, 300), "RGB")


def test_plots_take_the_right_third_and_leave_the_scene_unchanged() -> None:
    assert main(["render", "run.mcap", "a.png", "--size", "400x360", "--time", "0.5"]) == 0
    assert main(["render", "run.mcap", "b.png", "--size", "600x360", "--time", "0.5", "--plots"]) == 2
    assert main(["render", "run.mcap", "b.png", "--size", "720x360", "--time", "0.5", "--plots"]) == 0
    assert main(["render", "run.mcap", "c.png", "--size", "480x360", "--time", "0.5"]) == 0
    with Image.open("b.png") as both, Image.open("c.png") as scene:
        assert both.size == (720, 360)
        assert (colours(both)[:, :480] == colours(scene)).all()
        assert (colours(both)[:, 480:] > 250).all(axis=2).mean() > 0.5


def test_an_mp4_has_a_common_format_and_shows_the_drawn_pictures() -> None:
    assert main(["render", "run.mcap", "run.mp4", *SMALL]) == 0
    with av.open("run.mp4") as container:
        (stream,) = container.streams
        context = stream.codec_context
        assert (context.name, context.pix_fmt, context.profile) == ("h264", "yuv420p", "High")
        assert (context.width, context.height, stream.average_rate) == (400, 300, 25)
        frames = [colours(frame.to_image()) for frame in container.decode(stream)]
        assert float(stream.duration * stream.time_base) == pytest.approx(len(frames) / 25)
    assert len(frames) == 16  # at 0, 0.04 … 0.6 s
    for time, frame, other in ((0.0, frames[0], frames[-1]), (0.6, frames[-1], frames[0])):
        assert main(["render", "run.mcap", "still.png", *SMALL, "--time", str(time)]) == 0
        with Image.open("still.png") as still:
            moving = np.abs(frame - other).max(axis=2) > 60
            assert moving.sum() > 50
            right, wrong = (np.abs(colours(still) - shown)[moving].mean() for shown in (frame, other))
        assert right < 0.25 * wrong
    head = Path("run.mp4").read_bytes()
    assert 0 < head.index(b"moov") < head.index(b"mdat")  # plays while it loads


def test_colours_survive_the_encoding() -> None:
    """Flat ones, as edges lose some. In another matrix or range they would be off by 10."""
    bars = np.zeros((64, 64 * len(Palette.LIGHT), 3), np.uint8)
    for k, colour in enumerate(Palette.LIGHT.values()):
        bars[:, 64 * k : 64 * (k + 1)] = np.array(Palette.LIGHT.rgb(colour)) * 255.0 + 0.5
    write_mp4(Path("bars.mp4"), [Image.fromarray(bars)] * 2, 25.0, (bars.shape[1], 64))
    with av.open("bars.mp4") as container:
        frame = next(container.decode(video=0))
        assert (frame.colorspace, frame.color_range) == (Colorspace.ITU709, ColorRange.MPEG)
        middle = (slice(32, 33), slice(32, None, 64))
        # FFmpeg rounds down three times on the way back.
        assert np.abs(colours(frame.to_image())[middle] - bars[middle]).max() <= 4.0


def test_speed_and_rate_make_a_video_shorter_or_finer() -> None:
    shown: list[float] = []
    settings = render_settings(Path("run.mp4"), size="400x300", speed=2.0, fps=30.0)
    assert draw_runs(read_log("run.mcap"), settings, shown.append) == sum(shown) == pytest.approx(0.6)
    with av.open("run.mp4") as container:
        assert sum(1 for _ in container.decode(video=0)) == 10
        assert container.streams.video[0].average_rate == 30.0


def test_a_gif_loops_in_real_time_with_the_colours_of_the_legend() -> None:
    assert main(["render", "run.mcap", "run.gif", "--fps", "12"]) == 0
    with Image.open("run.gif") as picture:
        shown = [(each.info["duration"], colours(each)) for each in ImageSequence.Iterator(picture)]
        assert (picture.info["loop"], picture.size) == (0, (480, 360))
    durations, frames = zip(*shown, strict=True)
    assert len(durations) == 9  # at 0, 1/12 … 0.6 s
    assert sum(durations) == 750
    assert set(durations) <= {80, 90}
    for colour in ((0xCF, 0x5D, 0x06), (0x0C, 0x7D, 0x59)):
        assert (np.abs(frames[-1] - colour) < 2).all(axis=2).sum() > 5
    assert (frames[0] != frames[-1]).any()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run.mcap", "run"], "allowed: .mp4"),
        (["run.mcap", "run.png", "--time", "0.7"], "--time 0.7 is outside the run"),
        (["run.mcap", "run.png", "--time", "nan"], "allowed: 0 to 0.6 s"),
        (["run.mcap", "run.png", "--fps", "5"], "has no --fps or --speed"),
        (["run.mcap", "run.mp4", "--time", "0.1"], "shows the whole run"),
        (["run.mcap", "run.mp4", "--fps", "nan"], "--fps nan"),
        (["run.mcap", "run.mp4", "--fps", "0"], "allowed: 1 to 60"),
        (["run.mcap", "run.mp4", "--speed", "-1"], "allowed: 0.01 to 100"),
        (["run.mcap", "run.gif", "--speed", "0.01", "--fps", "60"], "a GIF of 3601 pictures"),
        (["run.mcap", "run.png", "--size", "wide"], "--size wide"),
        (["run.mcap", "run.png", "--size", "401x300"], "even numbers from 400x300 to 3840x2160"),
        (["run.mcap", "run.png", "--size", "5000x300"], "--size 5000x300"),
        (["run.mcap", "run.png", "--size", "500x298"], "--size 500x298"),
        (["run.mcap", "run.png", "--camera", "sid"], "did you mean 'side'?"),
        (["run.mcap", "run.png", "--camera", "x"], "side, top (the drawn model has no other cameras)"),
        (["half.mcap", "run.mp4"], "half.mcap"),
    ],
)
def test_wrong_input_is_refused_and_nothing_is_written(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = Path("run.mcap").read_bytes()
    Path("half.mcap").write_bytes(whole[: len(whole) // 2])
    assert main(["render", *arguments]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "Traceback" not in error
    assert {path.name: path.stat().st_size for path in Path().iterdir()} == {
        "run.mcap": len(whole), "half.mcap": len(whole) // 2,
    }  # fmt: skip


def test_without_the_encoder_only_videos_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    assert main(["render", "run.mcap", "run.mp4"]) == 2
    assert "pip install 'cranectl[video]'" in capsys.readouterr().err
    assert main(["render", "run.mcap", "run.png", *SMALL]) == 0


@pytest.mark.parametrize("name", ["run.mp4", "run.gif"])
def test_an_interrupted_command_leaves_only_the_old_file(name: str) -> None:
    old = b"GIF89a" if name.endswith(".gif") else b"\0\0\0\x20ftypisom"
    Path(name).write_bytes(old)
    drawn: list[float] = []

    def interrupt(seconds: float) -> None:
        drawn.append(seconds)
        if len(drawn) == 3:
            raise KeyboardInterrupt

    settings = render_settings(Path(name), size="400x300")
    with pytest.raises(KeyboardInterrupt):
        draw_runs(read_log("run.mcap"), settings, interrupt)
    assert Path(name).read_bytes() == old
    assert {path.name for path in Path().iterdir()} == {"run.mcap", name}
