"""Models as TOML files: read, validated, turned into mechanism, paths and study."""

from paraflex.files.generators import generator_names
from paraflex.files.laws import ExpressionLaw
from paraflex.files.library import library_file, library_names, library_text
from paraflex.files.model import Model, load, load_data, load_path, model_from
from paraflex.files.schema import model_schema
from paraflex.files.study import StudyDefaults

__all__ = [
    "ExpressionLaw",
    "Model",
    "StudyDefaults",
    "generator_names",
    "library_file",
    "library_names",
    "library_text",
    "load",
    "load_data",
    "load_path",
    "model_from",
    "model_schema",
]
