"""External engines on the same mechanism, torques and start: adapters for comparison."""

from paraflex.engines.common import ENGINES as ENGINES, check_dwell as check_dwell, check_engine as check_engine
