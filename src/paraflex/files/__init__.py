"""Models as TOML files: read, validated, turned into mechanism, paths and study."""

from paraflex.files.library import library_file, library_names
from paraflex.files.model import Model, StudyDefaults, load, load_path
from paraflex.files.schema import model_schema

__all__ = ["Model", "StudyDefaults", "library_file", "library_names", "load", "load_path", "model_schema"]
