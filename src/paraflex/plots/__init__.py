"""Figures of results, each a function from a dataset, or from numbers read from a file, to a Matplotlib figure.

What they have in common:

data, figures, table
    Results of the kind that `paraflex plot --list` has the figure for: a dataset (from `paraflex.results` or
    `studies.Verification.dataset`), the plain numbers of a study's result, or its table of designs; or the folder or
    file that they were written to.
mode, models, run
    Which of the runs: an actuation mode, two models of a verification, the number of a run. A mode that may be left
    out is then the one with most active motors.
metrics
    Of many designs; by default the first that vary.

An `InputError` says that results are of another kind or hold nothing to show, or that there is no such mode, model, run
or metric.

The names below are imported when they are first used: most commands need one or two of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
