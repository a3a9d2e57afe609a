"""The figure of numerical damping in docs/integrators.md.

    python benchmarks/numerical_damping.py [FILE.png]

Damping ratio, period error and spectral radius of every method over h omega, from their characteristic roots.
"""

from __future__ import annotations

import sys

from paraflex.plots import numerical_damping
from paraflex.plots.style import journal_style


def main() -> None:
    file = sys.argv[1] if len(sys.argv) > 1 else "docs/images/numerical_damping.png"
    figure = numerical_damping()
    with journal_style():
        figure.savefig(file, metadata={})


if __name__ == "__main__":
    main()
