"""Reading, validation and writing of TOML model files, which describe a mechanism, its paths and a study."""

from paraflex.files.generators import generator_names as generator_names
from paraflex.files.library import (
    library_file as library_file,
    library_names as library_names,
    library_text as library_text,
)
from paraflex.files.model import (
    Model as Model,
    load as load,
    load_data as load_data,
    load_path as load_path,
    model_from as model_from,
    plan as plan,
)
from paraflex.files.outside import allowing_outside as allowing_outside
from paraflex.files.profiles import ExpressionProfile as ExpressionProfile
from paraflex.files.schema import model_schema as model_schema
from paraflex.files.study import StudyDefaults as StudyDefaults
