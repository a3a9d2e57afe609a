"""Which motors of the 4-RRR should work? Every mode that the file names, with one motor failing after the other."""

from __future__ import annotations

import paraflex as pf


def main() -> dict[str, float]:
    robot = pf.load("4rrr")
    path = robot.paths["circle"]
    task = pf.plan(robot.mechanism.with_geometry("second-order"), path, samples=301)
    data = pf.tracking_dataset([task.simulate(mode.name) for mode in robot.mechanism.modes])
    print(" mode   error   peak torque   worst condition")
    for mode in data["tracking_rms_motion"].sortby(data["tracking_rms_motion"])["mode"].values:
        one = data.sel(mode=mode)
        error, torque = 1e6 * float(one["tracking_rms_motion"]), float(one["peak_torque"].max())
        print(f" {mode}  {error:5.1f} um  {torque:6.2f} N m  {float(one['actuation_condition'].max()):8.1f}")
    return {str(mode): float(data["tracking_rms_motion"].sel(mode=mode)) for mode in data["mode"].values}


if __name__ == "__main__":
    main()
