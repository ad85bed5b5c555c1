from .controller_fmu import controller_fmu as controller_fmu
from .fmu import fmu_archive as fmu_archive
from .package import exported_files as exported_files
from .plant import plant_model as plant_model
from .prepared import Exported as Exported
from .prepared import prepare_export as prepare_export
