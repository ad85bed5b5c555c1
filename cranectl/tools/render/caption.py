"""Text on pictures: scenario, time, error of the load, and a legend."""

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path

import matplotlib
from PIL import Image, ImageDraw, ImageFont

from cranectl.scenario import Drawing
from cranectl.support import Array, Palette, Quantity
from cranectl.tools.render.outline import OUTLINE_OPACITY
from cranectl.tools.render.timeline import Timeline, Track

SUPERSAMPLING = 4  # of symbols, since Pillow draws shapes with hard edges
PLATE_COLOUR = (255, 255, 255, 175)  # behind the legend
_FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"

Pen = ImageDraw.ImageDraw
ScaleLabel = tuple[str, tuple[float, float]]  # a text and its position [px]
# Draws a symbol of the legend at a height, with a width and a scale.
Symbol = Callable[[Pen, float, float, float], None]


@lru_cache
def font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return the font that ships with Matplotlib, so that pictures look the same everywhere."""
    return ImageFont.truetype(_FONTS / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"), size)


class Caption:
    """Draws text and legend onto pictures of one timeline and size, at some times [s]."""

    def __init__(
        self, timeline: Timeline, times: Array, size: tuple[int, int], scale: ScaleLabel | None
    ) -> None:
        width, height = size
        self._timeline, self._width, self._legend = timeline, width, legend(timeline, times)
        # Letters shrink with the picture, but stay legible.
        self._unit = max(min(width / 960.0, height / 720.0), 0.62)
        self._fixed = self._fixed_parts(width, height, scale)

    def draw(self, picture: Image.Image, time: float) -> None:
        """Draw the fixed parts and the readings at `time` [s]."""
        picture.paste(self._fixed, (0, 0), self._fixed)
        pen = ImageDraw.Draw(picture)
        right, y = self._width - self._px(24), self._px(18)
        pen.text(
            (right, y), f"{time:.2f} s", Palette.LIGHT["ink"], font(self._px(24), bold=True), anchor="ra"
        )
        y += self._px(34)
        for text, role in readings(self._timeline, time):
            pen.text((right, y), text, Palette.LIGHT[role], font(self._px(15)), anchor="ra")
            y += self._px(21)

    def _fixed_parts(self, width: int, height: int, scale: ScaleLabel | None) -> Image.Image:
        layer = Image.new("RGBA", (width, height), (255, 255, 255, 0))
        pen = ImageDraw.Draw(layer)
        left, run = self._px(24), self._timeline.main.run
        runs = [track.run for track in self._timeline.tracks]
        controllers = ", ".join(dict.fromkeys(run.design.name for run in runs))
        subtitle = f"{controllers}, {' and '.join(dict.fromkeys(run.drive for run in runs))} drives"
        for y, text, role, letters in (
            (18, run.scenario.name, "ink", font(self._px(24), bold=True)),
            (52, subtitle, "muted", font(self._px(15))),
        ):
            pen.text((left, self._px(y)), _shorten(text, letters, 0.62 * width), Palette.LIGHT[role], letters)
        if scale:
            length, (right, middle) = scale
            place = right + self._px(8), middle
            pen.text(place, length, Palette.LIGHT["ink"], font(self._px(15)), anchor="lm")
        if rows := self._legend:
            self._draw_legend(layer, rows)
        return layer

    def _draw_legend(self, layer: Image.Image, rows: list[tuple[Symbol, str]]) -> None:
        pen, left, height = ImageDraw.Draw(layer), self._px(24), layer.height
        step, symbol_width = self._px(23), self._px(30)
        top = height - self._px(14) - step * len(rows)
        letters, gap = font(self._px(14)), self._px(8)
        right = left + self._px(40) + max(round(letters.getlength(text)) for _, text in rows)
        plate = (left - gap, top - gap // 2, right + gap, height - self._px(14) + gap // 2)
        pen.rounded_rectangle(plate, radius=gap, fill=PLATE_COLOUR)  # the crane may be behind
        size = symbol_width, step * len(rows)
        symbols = Image.new("RGBA", (SUPERSAMPLING * size[0], SUPERSAMPLING * size[1]), (255, 255, 255, 0))
        for k, (symbol, text) in enumerate(rows):
            middle = (k + 0.5) * step
            lengths = (SUPERSAMPLING * length for length in (middle, symbol_width, self._unit))
            symbol(ImageDraw.Draw(symbols), *lengths)
            pen.text((left + self._px(40), top + middle), text, Palette.LIGHT["ink"], letters, anchor="lm")
        layer.alpha_composite(symbols.resize(size, Image.Resampling.BOX), (left, top))

    def _px(self, length: float) -> int:
        return round(length * self._unit)


def _shorten(text: str, letters: ImageFont.FreeTypeFont, width: float) -> str:
    if letters.getlength(text) <= width:
        return text
    length = next(n for n in range(len(text), -1, -1) if letters.getlength(text[:n] + "…") <= width)
    return text[:length] + "…"


def readings(timeline: Timeline, time: float) -> list[tuple[str, str]]:
    """Return the texts at `time` [s], each with the role of its colour."""
    errors = {t.label: t.error[t.row(time)] for t in timeline.tracks if t.run.has_reference}
    main, worst = timeline.main.label, max(errors, key=errors.__getitem__, default="")
    labels = [label for label in dict.fromkeys((main, worst)) if label in errors]
    if not timeline.by_label:
        labels = labels[:1]
    names = labels if timeline.by_label else ["load"]
    texts = [
        f"{name} off by {Quantity(errors[label], 'm').difference()}"
        for name, label in zip(names, labels, strict=False)
    ]
    if (distance := timeline.distance(time)) is not None:
        text = Quantity(distance, "m").difference()
        texts.append(f"others up to {text} away" if timeline.by_label else f"plants apart by {text}")
    lines = [(text, "muted") for text in texts]
    stops = {track.label: track.run.status.label for track in timeline.tracks if track.stopped(time)}
    if len(stops) == len(timeline.tracks) and len(set(stops.values())) == 1:
        return [*lines, (f"stopped: {next(iter(stops.values()))}", "limit")]
    return lines + [(f"{name} stopped: {label}", "limit") for name, label in stops.items()]


def legend(timeline: Timeline, times: Array) -> list[tuple[Symbol, str]]:
    """Return the symbols of what pictures at `times` [s] show, each with its meaning."""
    symbols = [*_legend_of_runs(timeline, times)]
    main = timeline.main
    rows = _rows(main, times)
    if main.run.has_reference:
        symbols.append((_ball, "where the load should be"))
        if len(timeline.path_dashes):
            symbols.append((_dashed, "its whole path"))
    acts = main.run.has("disturbance") and main.run.block("disturbance")[rows].any()
    if acts or main.run.load_force[rows].any():
        symbols.append((_arrow, "disturbance"))
    if any(track.nearly_slack[_rows(track, times)].any() for track in timeline.tracks):
        symbols.append((partial(_line, colour=Palette.VIEWER["slack-rope"]), "rope nearly slack"))
    return symbols


def _legend_of_runs(timeline: Timeline, times: Array) -> Iterator[tuple[Symbol, str]]:
    others = timeline.others
    for track in timeline.tracks:
        name = track.label if timeline.by_label else f"{track.label} plant"
        if track.is_ghost and timeline.has_user_model:
            colour, turn = f"{track.colour}{round(255 * OUTLINE_OPACITY):02x}", others.index(track)
            symbol = partial(_dashes_in_turn, colour=colour, turn=turn, turns=len(others))
            yield symbol, f"{name}: outline"
        elif track.is_ghost:
            yield partial(_line, colour=track.colour + "66", width=9), f"{name}: ghost"
        elif others and not timeline.has_user_model:
            yield partial(_line, colour=track.colour), f"{name}: solid"
        elif any(track.has_visible_trail(row) for row in _rows(track, times)):
            duration = f"last {Drawing(track.run.scenario.rig).trail:.0f} s"
            yield partial(_line, colour=track.colour), f"{name}, {duration}"


def _rows(track: Track, times: Array) -> list[int]:
    return [track.row(time) for time in times]


def _line(pen: Pen, middle: float, right: float, unit: float, *, colour: str, width: float = 3) -> None:
    half = width * unit / 2
    pen.rectangle((0, middle - half, right, middle + half), fill=colour)


def _dashes_in_turn(
    pen: Pen, middle: float, right: float, unit: float, *, colour: str, turn: int, turns: int
) -> None:
    dash = right / (2 * turns)
    for k in (turn, turn + turns):
        pen.rectangle((k * dash, middle - 1.5 * unit, (k + 1) * dash, middle + 1.5 * unit), fill=colour)


def _dashed(pen: Pen, middle: float, right: float, unit: float) -> None:
    dash = right / 5
    for k in (0, 2, 4):
        pen.rectangle((k * dash, middle - unit, (k + 1) * dash, middle + unit), fill=Palette.LIGHT["ink"])


def _ball(pen: Pen, middle: float, right: float, unit: float) -> None:
    pen.circle((right / 2, middle), 6 * unit, fill=Palette.LIGHT["series-3"])


def _arrow(pen: Pen, middle: float, right: float, unit: float) -> None:
    neck, colour = right - 12 * unit, Palette.LIGHT["series-4"]
    pen.rectangle((0, middle - 1.5 * unit, neck, middle + 1.5 * unit), fill=colour)
    pen.polygon(((neck, middle - 6 * unit), (right, middle), (neck, middle + 6 * unit)), fill=colour)
