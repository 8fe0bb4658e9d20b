"""The report: one self-contained HTML page."""

from cylinder_friction.evaluation.report.report import ReportInputs, report_html

__all__ = ["ReportInputs", "report_html"]
