"""The benchmark as one self-contained HTML page: every figure is SVG in the page, nothing is loaded."""

from cylinder_friction.evaluation.benchmark.report.write import write_report

__all__ = ["write_report"]
