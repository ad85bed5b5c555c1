"""Find what the names of a rig stand for in a user's model, and guess those that are missing."""

import shlex
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cranectl.scenario import ModelNames, RigParameters, override
from cranectl.support import InputError

# The setting of a rig that has no such drive.
FIXED = {"bridge_drive": ("axes", "y"), "trolley_drive": ("axes", "x"), "winch_drive": ("rope", "fixed")}
JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
KNOWN = ("rig.plant.names.", "rig.axes=", "rig.rope=")  # what a user may know of a model
SAME = 1e-6  # [m] between a point and its name
ALONG = 0.99  # cosine, of a rail and the axis that it runs along


def complete_names(file: Path, spec: mujoco.MjSpec, names: ModelNames) -> None:
    """Make sites of bodies and geoms that stand for pivot and load.

    Of a body that is the pivot, the origin of its frame counts, and of one that is the load, the centre of
    mass. Raises InputError, with all that is missing, if a name is not in the model.
    """
    missing, allowed = [], _allowed(spec)  # before sites are added
    for key, name in names:
        if not name and key.endswith("drive"):  # of a fixed axis
            continue
        if key == "keyframe":
            _check_keyframe(file, spec, name)
            continue
        kind = "actuator" if key.endswith("drive") else "site"
        if name in _names(spec.actuators if kind == "actuator" else spec.sites):
            continue
        if kind == "actuator" or not _add_site(spec, key, name):
            missing.append((key, kind, name))
    if missing:
        guesses = dict(_guesses(spec.compile()))
        unguessed = [key for key, _, _ in missing if key.endswith("drive") and key not in guesses]
        lacking = sum(map(bool, names.drives)) - len(spec.actuators)
        fixed = unguessed if len(unguessed) == lacking and not _moves_nowhere(unguessed) else []
        named = [key for key, _, _ in missing if key not in fixed]
        settings = ["rig.{}={}".format(*FIXED[key]) for key in fixed]
        settings += [f"rig.plant.names.{key}={guesses.get(key, 'NAME')}" for key in named]
        raise InputError(
            f"{file} has "
            + ", and ".join(f"no {kind} named '{name}' for the {_words(key)}" for key, kind, name in missing),
            allowed=allowed,
            remedy=f"add {' '.join(f'--set {shlex.quote(setting)}' for setting in settings)}"
            + ("" if all(key in guesses for key in named) else ", or add it to the file"),
        )


def _moves_nowhere(lacking: Collection[str]) -> bool:
    """Return True if neither bridge nor trolley is left without the drives that are `lacking`."""
    return {"bridge_drive", "trolley_drive"} <= {*lacking}


def guess_rig(file: Path, spec: mujoco.MjSpec, overrides: Sequence[str] = ()) -> RigParameters:
    """Return a rig with the names that the geometry of a model suggests; an axis without a drive is fixed.

    Default names of sites that the model has are kept, and `overrides` are known. Raises InputError if no
    pivot or no load is found, and for overrides of anything else.
    """
    for assignment in overrides:
        if not assignment.startswith(KNOWN):
            raise InputError(
                f"--set {assignment} for a model, which says itself what it has",
                allowed=f"--set {', '.join(KNOWN)}",
                remedy="leave it out, and write it into the rig",
            )
    given = override({"rig": {}}, overrides)["rig"]
    model, usual, known = spec.compile(), ModelNames(), given.pop("plant", {}).get("names", {})
    sites = _names(spec.sites)
    names = {**dict(_guesses(model)), **{k: name for k, name in usual if name in sites}, **known}
    lacking = [_words(key) for key in ("pivot", "load") if key not in names]
    missing = [key for key in FIXED if key not in names]
    if lacking or _moves_nowhere(missing):
        unknown = [key for key in ("pivot", "load") if key not in names] or ["bridge_drive"]
        raise InputError(
            f"{file}: nothing shows what is its {' or its '.join(lacking) or 'drive along x or y'}",
            allowed="a model whose drives slide a body along x or y, below which another body hangs",
            remedy=f"name them: add {' '.join(f'--set rig.plant.names.{key}=NAME' for key in unknown)}",
        )
    table = {
        **dict(FIXED[key] for key in missing),
        **given,
        "plant": {"names": {**_hanging_pose(model, names), **names}},
    }
    return RigParameters.from_table(table, str(file))


def _hanging_pose(model: mujoco.MjModel, names: Mapping[str, str]) -> dict[str, str]:
    """Return the first keyframe in which load and pivot are apart, unless they are in the file's pose."""
    data = mujoco.MjData(model)
    for pose in (None, *range(model.nkey)):
        if pose is not None:
            data.qpos[:] = model.key_qpos[pose]
        mujoco.mj_kinematics(model, data)
        pivot, load = (_place(data, key, names[key]) for key in ("pivot", "load"))
        if np.linalg.norm(load - pivot) > 0.0 and (pose is None or model.key(pose).name):
            return {} if pose is None else {"keyframe": str(model.key(pose).name)}
    return {}


def _place(data: mujoco.MjData, key: str, name: str) -> Any:
    """Return where the site or body `name` is that stands for pivot or load, as `complete_names` has it."""
    try:
        return data.site(name).xpos.copy()
    except KeyError:
        body = data.body(name)
        return (body.xipos if key == "load" else body.xpos).copy()


def _check_keyframe(file: Path, spec: mujoco.MjSpec, name: str) -> None:
    known = _names(spec.keys)
    if name and name not in known:
        raise InputError(
            f"{file} has no keyframe named '{name}'",
            allowed=f"keyframes of the model: {', '.join(known) or 'none'}",
            remedy=f"add --set rig.plant.names.keyframe={shlex.quote(known[0])}"
            if known
            else "leave out rig.plant.names.keyframe",
        )


def _words(key: str) -> str:
    return key.replace("_", " ")


def _names(elements: Iterable[Any]) -> list[str]:
    return [element.name for element in elements if element.name]


def _allowed(spec: mujoco.MjSpec) -> str:
    """Return the names of the model that may stand for a point or a drive, in words."""
    kinds = {"sites": spec.sites, "bodies": spec.bodies[1:], "actuators": spec.actuators}
    return "; ".join(f"{kind} of the model: {', '.join(_names(of)) or 'none'}" for kind, of in kinds.items())


def _add_site(spec: mujoco.MjSpec, key: str, name: str) -> bool:
    """Add a site for the body or geom `name`; return False if there is neither."""
    if name in _names(spec.bodies):
        at = spec.compile().body(name).ipos.tolist() if key == "load" else [0.0] * 3
        spec.body(name).add_site(name=name, pos=at)
    elif name in _names(spec.geoms):
        spec.geom(name).parent.add_site(name=name, pos=spec.compile().geom(name).pos.tolist())
    else:
        return False
    return True


def _guesses(model: mujoco.MjModel) -> Iterator[tuple[str, str]]:
    """Yield names for the keys of `ModelNames`, as far as the pose of the file shows them."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    yield from _guessed_drives(model, data)
    carried = _carried(model, data)
    along = set[str]().union(*carried.values())  # of x and y, the axes of this crane
    trolleys = [body for body, axes in carried.items() if body and axes == along]
    hangs = [body for body in range(1, model.nbody) if body not in carried]
    if not trolleys or not hangs:
        return
    trolley = trolleys[-1]  # children come later, so this is the last one that only its axes carry
    load = min(hangs, key=lambda body: float(data.xipos[body, 2]))
    # What hangs on joints swings about an anchor, and its centre of mass counts; what hangs on a rope has
    # sites at the ends of the rope.
    swinging = [body for body in hangs if model.body_parentid[body] == trolley and _swings(model, body)]
    anchor = data.xanchor[model.body_jntadr[swinging[0]]] if swinging else None
    for key, body in (("pivot", trolley), ("load", load)):
        sites = [k for k in range(model.nsite) if model.site_bodyid[k] == body and model.site(k).name]
        # Pivot and load are below each other; of several sites, the lowest is where a rope leaves or ends.
        across = np.linalg.norm(data.site_xpos[:, :2] - data.xipos[load, :2], axis=1)
        sites.sort(key=lambda k: (round(float(across[k]), 6), float(data.site_xpos[k, 2])))
        name = model.site(sites[0]).name if sites else model.body(body).name
        if anchor is not None:
            point, bodies = (anchor, [trolley, swinging[0]]) if key == "pivot" else (data.xipos[load], [load])
            places = data.xpos if key == "pivot" else data.xipos
            exact = [model.site(k).name for k in sites if np.allclose(data.site_xpos[k], point, atol=SAME)]
            exact += [model.body(b).name for b in bodies if np.allclose(places[b], point, atol=SAME)]
            name = next(filter(None, exact), name)
        if name:
            yield key, name


def _swings(model: mujoco.MjModel, body: int) -> bool:
    """Return whether the first joint of a body turns it about a point of its parent."""
    joint = int(model.body_jntadr[body])
    turning = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_BALL))
    return bool(model.body_jntnum[body]) and model.jnt_type[joint] in turning


def _guessed_drives(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[str, str]]:
    """Yield an actuator for each axis that has one: with the usual name of its drive, or else the first."""
    found: dict[str, list[str]] = {}
    for k in range(model.nu):
        of, name = int(model.actuator_trnid[k, 0]), str(model.actuator(k).name)
        kind = int(model.actuator_trntype[k])
        slides = kind in JOINTS and model.jnt_type[of] == int(mujoco.mjtJoint.mjJNT_SLIDE)
        axis = _axis(model, data, of) if slides else ""
        if name and (slides or kind == int(mujoco.mjtTrn.mjTRN_TENDON)):
            found.setdefault({"x": "bridge_drive", "y": "trolley_drive"}.get(axis, "winch_drive"), []).append(
                name
            )
    for key, names in found.items():
        yield key, key if key in names else names[0]


def _axis(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> str:
    """Return "x" or "y" for a joint that slides along it, else an empty text."""
    if model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_SLIDE):
        return ""
    along = np.abs(data.xaxis[joint]) > ALONG
    return "x" if along[0] else "y" if along[1] else ""


def _carried(model: mujoco.MjModel, data: mujoco.MjData) -> dict[int, set[str]]:
    """Return the axes along which bodies are carried, for those that no other joint moves."""
    axes: dict[int, set[str]] = {0: set()}
    for body in range(1, model.nbody):
        first = model.body_jntadr[body]
        own = {_axis(model, data, joint) for joint in range(first, first + model.body_jntnum[body])}
        if model.body_parentid[body] in axes and "" not in own:
            axes[body] = axes[model.body_parentid[body]] | own
    return axes
