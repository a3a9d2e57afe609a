"""Dataset of a driven motion: that of a run, with the properties of its kinematics."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.driven import DrivenMotion, Flywheel
from paraflex.findings import Finding
from .motion_data import motion_dataset

# Attribute of a dataset with the properties of a driven motion, as JSON.
KINEMATICS = "kinematics"


@checked_arguments()
def kinematics_dataset(
    motion: DrivenMotion,
    *,
    assemblies: bool = False,
    flywheel: Flywheel | None = None,
    parameters: dict[str, Any] | None = None,
    findings: Iterable[Finding] = (),
) -> xr.Dataset:
    """Return the dataset of a driven motion, as `motion_dataset`, with its properties in the attribute "kinematics".

    Parameters
    ----------
    motion : DrivenMotion
        Motion made by `kinematics` or `torques`.
    assemblies : bool
        Whether all assemblies are searched for.
    flywheel : Flywheel, optional
        Flywheel of the drive, stored with the properties.
    parameters, findings
        See `motion_dataset`.
    """
    data = motion_dataset(motion, parameters=parameters, findings=findings)
    joints = motion.system.mechanism.joints
    found: dict[str, Any] = {
        "drive": None if motion.drive is None else asdict(motion.drive) | {"full_turn": motion.drive.full_turn},
        "joint_units": {one.name: "m" if one.slides else "rad" for one in joints},
        **motion.features.to_dict(),
    }
    if assemblies:
        found["assemblies"] = [one._asdict() for one in motion.assemblies()]
    if flywheel is not None:
        found["flywheel"] = asdict(flywheel)
    # The motion is exact to rounding.
    data.attrs.pop("tolerance")
    data.attrs[KINEMATICS] = json.dumps(found)
    if np.isnan(motion.solution.multipliers).all():
        # Without forces these have no value either, where sums of nothing would be zero.
        for name in ("drive_energy", "motor_energy", "motor_power", "input_power"):
            if name in data:
                data[name] = data[name] * np.nan
    return data
