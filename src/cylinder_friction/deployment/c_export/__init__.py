"""Any estimator as one C99 source and one header: no allocation, no global state, no dependency but libm."""

from cylinder_friction.deployment.c_export.export import ExportedC, Precision, export_c, export_model, fingerprint
from cylinder_friction.deployment.c_export.models import Part, model_of, part_of

__all__ = ["ExportedC", "Part", "Precision", "export_c", "export_model", "fingerprint", "model_of", "part_of"]
