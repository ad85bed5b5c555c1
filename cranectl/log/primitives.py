"""Parts of Foxglove's 3-D messages from plain numbers; what is not set would be 0, and not be seen."""

from collections.abc import Iterable, Sequence
from typing import Any

from foxglove.messages import (
    Color,
    FrameTransform,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    Timestamp,
    Vector3,
)

from cranectl.scenario import NANOSECONDS

IDENTITY = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
ORIGIN = Pose(position=Vector3(x=0.0, y=0.0, z=0.0), orientation=IDENTITY)


def entity_of(frame: str, name: str, time_ns: int, **primitives: Sequence[object]) -> SceneEntity:
    """Shown until replaced, in a frame that it moves with."""
    return SceneEntity(
        timestamp=timestamp_of(time_ns),
        frame_id=frame,
        id=name,
        frame_locked=True,
        **primitives,  # type: ignore[arg-type]
    )


def transform_of(
    time: Timestamp,
    parent: str,
    child: str,
    translation: Sequence[float],
    rotation: Sequence[float] | None = None,
) -> FrameTransform:
    """A frame in its parent; without a rotation it is only moved."""
    return FrameTransform(
        timestamp=time,
        parent_frame_id=parent,
        child_frame_id=child,
        translation=vector_of(translation),
        rotation=IDENTITY if rotation is None else quaternion_of(rotation),
    )


def line_of(points: list[Point3], pixels: float, **more: Any) -> LinePrimitive:
    """A line as wide from near as from far, connected or as `more` says, of one colour or one a point."""
    kind = {"type": LinePrimitiveLineType.LineStrip, "scale_invariant": True, **more}
    return LinePrimitive(pose=ORIGIN, points=points, thickness=pixels, **kind)


def timestamp_of(time_ns: int) -> Timestamp:
    """Nanoseconds as a message has them."""
    return Timestamp(*divmod(time_ns, NANOSECONDS))


def vector_of(xyz: Iterable[float]) -> Vector3:
    """From (x, y, z)."""
    return Vector3(**dict(zip("xyz", xyz, strict=True)))


def points_of(rows: Iterable[Iterable[float]]) -> list[Point3]:
    """From rows (x, y, z)."""
    return [Point3(x=x, y=y, z=z) for x, y, z in rows]


def quaternion_of(xyzw: Iterable[float]) -> Quaternion:
    """From (x, y, z, w)."""
    return Quaternion(**dict(zip("xyzw", xyzw, strict=True)))


def colour_of(rgb: Sequence[float], opacity: float) -> Color:
    """From (r, g, b) and opacity."""
    return Color(**dict(zip("rgba", (*rgb, opacity), strict=True)))
