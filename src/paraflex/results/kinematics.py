"""Properties of a driven motion in the dataset of its run."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    from paraflex.driven import DrivenMotion, Flywheel

# Attribute of a dataset with the properties of a driven motion, as JSON.
KINEMATICS = "kinematics"


def add_kinematics(
    data: xr.Dataset, motion: "DrivenMotion", *, assemblies: bool = False, flywheel: "Flywheel | None" = None
) -> None:
    """Store the properties of a driven motion in its dataset, as JSON in the attribute "kinematics".

    Parameters
    ----------
    data : xarray.Dataset
        Dataset of the motion, changed in place.
    motion : DrivenMotion
        Motion made by `kinematics` or `torques`.
    assemblies : bool
        Whether all assemblies are searched for.
    flywheel : Flywheel, optional
        Flywheel of the drive, stored with the properties.
    """
    joints = motion.system.mechanism.joints
    found: dict[str, Any] = {
        "drive": None if motion.drive is None else asdict(motion.drive) | {"full_turn": motion.drive.full_turn},
        "over": _place(data, motion),
        "path": motion.path,
        "mode": motion.mode,
        "joint_units": {one.name: "m" if one.slides else "rad" for one in joints},
        **motion.features.to_dict(),
    }
    if assemblies:
        found["assemblies"] = [one._asdict() for one in motion.assemblies()]
    if flywheel is not None:
        found["flywheel"] = asdict(flywheel)
    data.attrs[KINEMATICS] = json.dumps(found)
    # The motion is exact to rounding.
    data.attrs.pop("tolerance", None)


def _place(data: xr.Dataset, motion: "DrivenMotion") -> str:
    """Return the joint over whose coordinate curves are drawn: the only drive, if it does not reverse; or none."""
    if motion.drive is not None:
        return motion.drive.joint
    prescribed = motion.system.mechanism.prescribed
    if motion.rigid is not None or len(prescribed) != 1:
        return ""
    steps = np.diff(data["joint_coordinate"].sel(joint=prescribed[0].joint).values)
    return prescribed[0].joint if np.all(steps > 0.0) or np.all(steps < 0.0) else ""
