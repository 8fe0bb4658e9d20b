"""What one estimate costs at batch 1 on one core, in every runtime, in one run, beside the floor of the machine."""

from cylinder_friction.deployment.latency.measuring import Effort, Measured, measure
from cylinder_friction.deployment.latency.report import as_dict, metrics_of, table
from cylinder_friction.deployment.latency.verdicts import Verdict, verdicts_on

__all__ = ["Effort", "Measured", "Verdict", "as_dict", "measure", "metrics_of", "table", "verdicts_on"]
