"""A run as a page for the browser: one HTML file that needs nothing else, no network either."""

from quietbus.report.page import report_page, write_report

__all__ = ["report_page", "write_report"]
