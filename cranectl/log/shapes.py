"""Building blocks of scene messages, with all fields set that viewers need: opacity, orientation, frame."""

from collections.abc import Iterable, Sequence

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

Rows = list[list[float]]

IDENTITY = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
ORIGIN = Pose(position=Vector3(x=0.0, y=0.0, z=0.0), orientation=IDENTITY)


def entity(frame: str, name: str, time_ns: int, **primitives: Sequence[object]) -> SceneEntity:
    """Shown until replaced, in a frame that it moves with."""
    return SceneEntity(
        timestamp=timestamp(time_ns),
        frame_id=frame,
        id=name,
        frame_locked=True,
        **primitives,  # type: ignore[arg-type]
    )


def transform(
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
        translation=vector(translation),
        rotation=IDENTITY if rotation is None else quaternion(rotation),
    )


def line(
    points: list[Point3],
    thickness: float,
    *,
    scale_invariant: bool = False,
    separate: bool = False,
    color: Color | None = None,
    colors: list[Color] | None = None,
) -> LinePrimitive:
    """A connected line, or of each two points a `separate` one, in one colour or in one for each point."""
    kind = LinePrimitiveLineType.LineList if separate else LinePrimitiveLineType.LineStrip
    return LinePrimitive(
        type=kind,
        pose=ORIGIN,
        thickness=thickness,
        scale_invariant=scale_invariant,
        points=points,
        color=color,
        colors=colors,
    )


def timestamp(time_ns: int) -> Timestamp:
    """Nanoseconds as a message has them."""
    return Timestamp(*divmod(time_ns, NANOSECONDS))


def vector(xyz: Iterable[float]) -> Vector3:
    """From (x, y, z)."""
    return Vector3(**dict(zip("xyz", xyz, strict=True)))


def points(rows: Iterable[Iterable[float]]) -> list[Point3]:
    """From rows (x, y, z)."""
    return [Point3(x=x, y=y, z=z) for x, y, z in rows]


def quaternion(xyzw: Iterable[float]) -> Quaternion:
    """From (x, y, z, w)."""
    return Quaternion(**dict(zip("xyzw", xyzw, strict=True)))


def colour(rgb: Sequence[float], opacity: float) -> Color:
    """From (r, g, b) and opacity."""
    return Color(**dict(zip("rgba", (*rgb, opacity), strict=True)))
