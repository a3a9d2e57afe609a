"""Values of records of runs that tests compare."""

import numpy as np

TIP = ("tip_axial", "tip_transverse", "tip_slope")


def values(run, name):
    """Values of a record; those of the tip (k, bodies, 3) together."""
    if name == "tip":
        return np.stack([run.links[part] for part in TIP], axis=-1)
    return run.torque if name == "torque" else run.links[name]
