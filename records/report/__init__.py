"""The verification report: one self-contained page, and a picture of a run for a README."""

from records.report.page import Context, render, write_report
from records.report.picture import write_picture

__all__ = ["Context", "render", "write_picture", "write_report"]
