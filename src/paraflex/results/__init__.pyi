from .comparison import RunComparison as RunComparison, compare as compare
from .dataset import tracking_dataset as tracking_dataset
from .following import (
    peak_torque as peak_torque,
    residual_vibration as residual_vibration,
    rms_torque as rms_torque,
    settling_times as settling_times,
    tracking_error as tracking_error,
)
from .kinds import kind_of as kind_of
from .linear_data import linear_dataset as linear_dataset
from .linear_summary import linear_summary as linear_summary
from .motion_data import motion_dataset as motion_dataset
from .reduction_data import reduction_dataset as reduction_dataset
from .reduction_summary import reduction_summary as reduction_summary
from .run_summary import motion_summary as motion_summary, summary as summary
from .statics_data import statics_dataset as statics_dataset, statics_summary as statics_summary
from .storage import (
    load_results as load_results,
    open_results as open_results,
    results_file as results_file,
    save_results as save_results,
)
