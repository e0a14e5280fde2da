"""The operator's page: a web server in a process of its own, which reads what the control process shows."""
