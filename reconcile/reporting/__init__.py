"""What is written: report.json, its check, what is printed, the extended model."""
