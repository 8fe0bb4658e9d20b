"""An estimator as an FMU: FMI 2.0 and 3.0 co-simulation around the exported C, sources included."""

from cylinder_friction.deployment.fmu.compiling import CompilerError
from cylinder_friction.deployment.fmu.exporting import ExportedFmu, export_fmu, export_model_fmu

__all__ = ["CompilerError", "ExportedFmu", "export_fmu", "export_model_fmu"]
