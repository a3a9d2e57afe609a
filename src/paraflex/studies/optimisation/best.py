"""Model file of the best design."""

from __future__ import annotations

import json
from pathlib import Path

from paraflex.campaign.study import Result
from paraflex.files.overlay import overlaid
from paraflex.studies.optimisation.study import DesignStudy
from paraflex.writing import write_text

BEST = "best.toml"


def write_best(folder: Path, study: DesignStudy[Result], design: tuple[float, ...]) -> Path:
    """Write the mechanism's file with the parameter values of a design, and return its path.

    Raises
    ------
    OutputError
        Folder that cannot be written.
    """
    from paraflex.files.document import document_text

    setting = study.setting
    data = overlaid(dict(setting.data), setting.numbers(design))
    lines = [f"# {setting.source}, with the numbers that the study {json.dumps(study.name)} found:"]
    lines += [f"#   {json.dumps(name)}: {value!r}" for name, value in zip(setting.names, design, strict=True)]
    write_text(folder / BEST, "\n".join([*lines, "", document_text(data, setting.text)]))
    return folder / BEST
