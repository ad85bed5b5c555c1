"""Files of pictures: PNG and GIF by Pillow, MP4 by PyAV."""

from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from cranectl.support.colours import LIGHT, SLACK_ROPE, rgb
from cranectl.support.errors import InputError

# Small enough to send, no loss that is seen; 4:2:0 pixels and this profile play everywhere.
H264 = {"crf": "20", "preset": "veryfast", "profile": "high"}
PIXELS = "yuv420p"
BT709 = 1  # the colours of high definition, in FFmpeg's numbering of matrices, primaries and curves
LIMITED = 1  # luma from 16 to 235, as players expect
COLOURS = 256
HUNDREDTHS = 100  # of a second, in which GIF counts time


def write_png(path: Path, picture: Image.Image) -> None:
    """A still."""
    picture.save(path, format="png", optimize=True)


def write_gif(
    path: Path, pictures: Iterable[Image.Image], count: int, fps: float, samples: Sequence[Image.Image]
) -> None:
    """An endless loop of `count` pictures. They share the palette of `samples`, so that nothing flickers."""
    montage = Image.new("RGB", (samples[0].width, samples[0].height * len(samples)))
    for k, sample in enumerate(samples):
        montage.paste(sample, (0, k * sample.height))
    # Thin lines are too few pixels to get colours of their own, but a legend says what they mean.
    accents = [round(255 * part) for colour in (*LIGHT.values(), SLACK_ROPE) for part in rgb(colour)]
    palette = Image.new("P", (1, 1))
    palette.putpalette((montage.quantize(COLOURS - len(accents) // 3).getpalette() or []) + accents)
    reduced = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    ends = [round(HUNDREDTHS * (k + 1) / fps) for k in range(count)]
    milliseconds = [1000 // HUNDREDTHS * (end - start) for start, end in zip([0, *ends], ends, strict=False)]
    first = next(reduced)
    with path.open("wb") as stream:  # Pillow would leave a file of its own open if it is interrupted
        first.save(stream, format="gif", save_all=True, append_images=reduced, duration=milliseconds, loop=0)


def check_encoder() -> None:
    """Raise InputError if there is no PyAV to encode a video with."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"no encoder for .mp4: {error}",
            allowed=".gif and .png without it",
            remedy="pip install 'cranectl[video]' (PyAV, which brings FFmpeg)",
        ) from None


def write_mp4(path: Path, pictures: Iterable[Image.Image], fps: float, size: tuple[int, int]) -> None:
    """H.264, to be played while it loads."""
    import av
    from av.video.reformatter import ColorRange, Colorspace

    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001), options=H264)
        stream.width, stream.height = size
        stream.pix_fmt = PIXELS
        stream.color_range, stream.colorspace = LIMITED, BT709
        stream.color_primaries, stream.color_trc = BT709, BT709

        def encode(picture: Image.Image) -> None:
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24").reformat(
                format=PIXELS, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
            container.mux(stream.encode(frame))

        # One picture is encoded while the next is drawn.
        with ThreadPoolExecutor(max_workers=1) as encoder:
            encoded: Future[None] | None = None
            for picture in pictures:
                if encoded is not None:
                    encoded.result()
                encoded = encoder.submit(encode, picture)
            if encoded is not None:
                encoded.result()
        container.mux(stream.encode())
