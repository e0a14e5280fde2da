"""DIR/report.html: what reconcile found, as one file that needs neither network nor server."""
