"""Reading, validation and writing of TOML model files, which describe a mechanism, its paths and a study."""

from .generators import generator_names as generator_names
from .library import library_file as library_file, library_names as library_names, library_text as library_text
from .model import (
    Model as Model,
    load as load,
    load_data as load_data,
    load_path as load_path,
    model_from as model_from,
    plan as plan,
)
from .outside import allowing_outside as allowing_outside
from .profiles import ExpressionProfile as ExpressionProfile
from .schema import model_schema as model_schema
from .study import StudyDefaults as StudyDefaults
