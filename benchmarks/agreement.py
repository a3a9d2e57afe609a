"""Do all methods find the same motion? RAParM-I, ++++, all 104 coordinates, each at tight settings.

    python benchmarks/agreement.py [--write] [METHOD ...]

The largest distance of the end-effector's path from a converged one, found by ESDIRK 5(4) and held against ESDIRK 4(3).
Takes about ten minutes, most of them for Newmark of order 1 and the explicit methods. SciPy's NDF, whose orders go up
to 5, would take longer than all others together: these links are not damped.
"""

from __future__ import annotations

import warnings

import numpy as np
from common import command_line, single_thread, write_json
from numpy.typing import NDArray

import paraflex as pf
from paraflex.integrators import METHODS, IntegrationOptions, Solution, find_method
from paraflex.integrators.external_run import StiffnessWarning
from paraflex.studies.cases import tracking_case

SETTINGS = {
    "tr-bdf2": {"tolerance": 1e-6},
    "trapezoidal": {"tolerance": 1e-6},
    "esdirk3": {"tolerance": 1e-6},
    "esdirk4": {"tolerance": 1e-6},
    "esdirk5": {"tolerance": 1e-6},
    "newmark": {"tolerance": 3e-6},
    "newmark, undamped": {"tolerance": 1e-6, "parameters": {"gamma": 0.5}},
    "wilson-theta": {"tolerance": 1e-6},
    "hht-alpha": {"tolerance": 1e-6},
    "generalised-alpha": {"tolerance": 1e-6},
    "rk45": {"tolerance": 1e-5},
    "radau": {"tolerance": 1e-6},
    "adams": {"tolerance": 1e-6},
    "bdf": {"tolerance": 1e-5},
    "ida": {"tolerance": 5e-6},
    "ida, ggl": {"tolerance": 5e-6, "constraints": "ggl"},
}


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("method", nargs="*", default=list(SETTINGS))
    given = parser.parse_args()
    single_thread()
    model = pf.load("raparm_i")
    case = tracking_case(pf.plan(model.mechanism, model.path("square"), duration=0.7), "++++")

    def run(**options) -> tuple[NDArray[np.float64], Solution]:
        solution = case.solve(IntegrationOptions(**options), None)
        return case.places(solution), solution

    def distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        return float(np.max(np.linalg.norm(a - b, axis=-1)))

    warnings.simplefilter("ignore", StiffnessWarning)
    converged, _ = run(method="esdirk5", tolerance=1e-8)
    check, _ = run(method="esdirk4", tolerance=1e-8)
    apart = distance(converged, check)
    print(f"converged path, two methods apart {apart:.1e} m")
    print(f"{'method':>20} {'tolerance':>10} {'distance':>9} {'energy':>9} {'steps':>8} {'time':>9}")
    rows = []
    for name in given.method:
        settings = SETTINGS[name]
        options = {key: value for key, value in settings.items() if key != "parameters"}
        path, solution = run(method=find_method(name.split(",")[0], settings.get("parameters")), **options)
        row = {
            "method": name,
            **settings,
            "distance": distance(path, converged),
            "energy_imbalance": solution.energy_balance_max,
            "steps": solution.steps,
            "wall_time": solution.wall_time,
        }
        rows.append(row)
        print(
            f"{name:>20} {settings['tolerance']:10.0e} {row['distance']:7.1e} m {solution.energy_balance_max:7.1e} J "
            f"{solution.steps:8d} {solution.wall_time:7.1f} s",
            flush=True,
        )
    missing = sorted(set(METHODS) - {name.split(",")[0] for name in given.method})
    if missing:
        print(f"not run: {', '.join(missing)}")
    write_json("agreement", {"apart": apart, "methods": rows}, given.folder)


if __name__ == "__main__":
    main()
