"""Studies whose runs take no time: metrics are formulas of the parameters."""

from __future__ import annotations

from paraflex.designs.run import STATUS_FAILED, Outcome, lost

STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++"]
duration = 0.15
samples = 26
metrics = ["tracking_rms", "peak_torque_max", "total_mass"]

[integration]
method = "esdirk5"
tolerance = 1e-4

[vary.x]
fields = ["section.bar.thickness"]
low = 0.002
high = 0.008

[vary.y]
fields = ["lump.end.mass"]
low = 0.1
high = 1.0
scale = "log"
"""


def write_study(folder, text, name="study.toml"):
    """A study file."""
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def made_up(**metrics):
    """A run whose metrics are formulas of the mode and the parameters; one that raises a ValueError fails."""

    def run(setting, task, watch=None):
        rows = lost(setting, task, "").rows
        for row in rows:
            try:
                row |= {name: formula(row["mode"], *task.values) for name, formula in metrics.items()}
                row |= {"status": "complete", "time_reached": 0.15}
            except ValueError as error:
                row |= {"status": STATUS_FAILED, "reason": str(error)}
        run.designs.append(task.values)
        return Outcome(task, rows)

    run.designs = []
    return run
