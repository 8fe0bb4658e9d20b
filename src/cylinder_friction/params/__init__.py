"""Every parameter of the pipeline, typed and frozen; an unknown key, a wrong type or an impossible value is refused.

``params.yaml`` is the composed configuration (from ``conf/``) that every stage reads. Only ``stages`` import this
package: the layers below take plain arguments.
"""

from cylinder_friction.params.checking import PARAMS_FILE, Params, ParamsError, check_params, load_params
from cylinder_friction.params.data import CylinderParams, FilterParams, LabelParams, RecordParams
from cylinder_friction.params.ingest import IngestParams
from cylinder_friction.params.learning import (
    BenchmarkParams,
    CompareParams,
    HybridParams,
    LugreParams,
    RegisterParams,
    SearchParams,
    TrainingParams,
    TrainParams,
)

__all__ = [
    "PARAMS_FILE",
    "BenchmarkParams",
    "CompareParams",
    "CylinderParams",
    "FilterParams",
    "HybridParams",
    "IngestParams",
    "LabelParams",
    "LugreParams",
    "Params",
    "ParamsError",
    "RecordParams",
    "RegisterParams",
    "SearchParams",
    "TrainParams",
    "TrainingParams",
    "check_params",
    "load_params",
]
