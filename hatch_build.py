"""Build hook: a wheel with compiled kernels, if PARAFLEX_KERNELS names the cache folder that holds them.

NUMBA_CACHE_DIR=FOLDER python -m paraflex.compilation
PARAFLEX_KERNELS=FOLDER python -m build --no-isolation --wheel
"""

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompiledKernels(BuildHookInterface):
    """Adds the kernels, and the tag of the Python and system that they are for."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Find the kernels of one state of the sources."""
        given = os.environ.get("PARAFLEX_KERNELS")
        if not given:
            return
        found = {stamp.parent for stamp in Path(given).resolve().glob("**/paraflex-kernels-*/compiled-*")}
        if len(found) != 1:
            raise ValueError(
                f"PARAFLEX_KERNELS={given} holds kernels of {len(found)} states; compile into a new folder"
            )
        (folder,) = found
        state = folder.name.removeprefix("paraflex-kernels-")
        build_data["force_include"][str(folder)] = f"paraflex/kernel/compiled/{state}"
        # The machine code calls nothing of the system's libraries that would depend on their release.
        system = sysconfig.get_platform().replace("-", "_").replace(".", "_").replace("linux_", "manylinux_2_17_")
        build_data["tag"] = f"cp{sys.version_info.major}{sys.version_info.minor}-none-{system}"
        build_data["pure_python"] = False
