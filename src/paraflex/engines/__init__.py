"""Other people's engines on the same mechanism, torques and start: adapters for comparison."""

from paraflex.engines.common import ENGINES, check_dwell, check_engine

__all__ = ["ENGINES", "check_dwell", "check_engine"]
