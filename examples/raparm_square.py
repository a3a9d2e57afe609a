"""RAParM-I on the square in two actuation modes: torques, simulation, tracking error, figure."""

from __future__ import annotations

import paraflex as pf


def main() -> dict[str, float]:
    robot = pf.load("raparm_i")  # or your own TOML file
    task = pf.plan(robot.mechanism, robot.paths["square"], duration=0.7)
    runs = [task.simulate(mode) for mode in ("+-+-", "++++")]
    data = pf.tracking_dataset(runs)
    for mode in data["mode"].values:
        peak = float(data["peak_torque"].sel(mode=mode).max())
        print(f"{mode}: tracking error {float(data['tracking_rms'].sel(mode=mode)):.2e} m, peak torque {peak:.1f} N m")
    pf.plots.end_effector_path(data, "++++").savefig("end_effector_path.png")
    return {str(mode): float(data["tracking_rms"].sel(mode=mode)) for mode in data["mode"].values}


if __name__ == "__main__":
    main()
