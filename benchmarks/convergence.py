"""Does the tolerance mean what it says? All six modes of the RAParM-I study against a converged run.

    python benchmarks/convergence.py [--write]

For each tolerance and mode: the tracking error's relative error, and the end-effector's largest distance from the
converged path in units of the tolerance, which should not exceed one by much. By TR-BDF2, as the
study states. Takes a minute.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from common import command_line, write_json

import paraflex as pf
from paraflex.integrators import IntegrationOptions

METHOD, CONVERGED = "tr-bdf2", 2e-6
TOLERANCES, SHOWN = (2e-4, 1e-4, 5e-5, 2e-5), 1e-4


def main() -> None:
    given = command_line(__doc__).parse_args()
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.path("square"), duration=0.7)

    def study(tolerance: float) -> xr.Dataset:
        result = pf.run_study(task, model.study.modes, options=IntegrationOptions(method=METHOD, tolerance=tolerance))
        assert result.data is not None
        return result.data

    reference = study(CONVERGED)
    print(f"converged (tolerance {CONVERGED:g} m):")
    for mode in reference["mode"].values:
        print(f"  {mode}  tracking error {float(reference['tracking_rms'].sel(mode=mode)):.4e} m")
    print(f"{'tolerance':>10}  mode  {'error':>7}  {'distance':>9}  {'steps':>7}")
    rows = []
    for tolerance in TOLERANCES:
        data = study(tolerance)
        distance = np.linalg.norm(data["end_effector"] - reference["end_effector"], axis=-1).max(axis=1)
        change = np.abs(data["tracking_rms"] / reference["tracking_rms"] - 1.0)
        for i, mode in enumerate(data["mode"].values):
            print(
                f"{tolerance:10.0e}  {mode}  {float(change[i]):7.2%}  {distance[i] / tolerance:9.2f}  "
                f"{int(data['steps'][i]):7d}"
            )
            rows.append(
                {
                    "tolerance": tolerance, "mode": str(mode), "converged": float(reference["tracking_rms"][i]),
                    "error": float(change[i]), "distance": float(distance[i] / tolerance),
                    "energy_imbalance": float(data["energy_balance_max"][i]),
                }
            )  # fmt: skip
    shown = [row for row in rows if row["tolerance"] == SHOWN]
    found = {
        "method": METHOD, "tolerance": CONVERGED, "shown": shown, "rows": rows,
        "farthest": max(rows, key=lambda row: row["distance"]),
        "energy_imbalance": max(row["energy_imbalance"] for row in shown),
    }  # fmt: skip
    write_json("convergence", found, given.folder)


if __name__ == "__main__":
    main()
