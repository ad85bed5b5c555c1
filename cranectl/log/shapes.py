"""Building blocks of scene messages, with all fields set that viewers need: opacity, orientation, frame."""

from collections.abc import Sequence

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


def line(points: Rows, thickness: float, colour: Color) -> LinePrimitive:
    """A connected line in one colour."""
    return LinePrimitive(
        type=LinePrimitiveLineType.LineStrip,
        pose=ORIGIN,
        thickness=thickness,
        points=[point(xyz) for xyz in points],
        color=colour,
    )


def timestamp(time_ns: int) -> Timestamp:
    """Nanoseconds as a message has them."""
    return Timestamp(*divmod(time_ns, NANOSECONDS))


def vector(values: Sequence[float]) -> Vector3:
    """From (x, y, z)."""
    x, y, z = values
    return Vector3(x=x, y=y, z=z)


def point(values: Sequence[float]) -> Point3:
    """From (x, y, z)."""
    x, y, z = values
    return Point3(x=x, y=y, z=z)


def quaternion(values: Sequence[float]) -> Quaternion:
    """From (x, y, z, w)."""
    x, y, z, w = values
    return Quaternion(x=x, y=y, z=z, w=w)


def colour(rgb: Sequence[float], opacity: float) -> Color:
    """From (r, g, b) and opacity."""
    r, g, b = rgb
    return Color(r=r, g=g, b=b, a=opacity)
