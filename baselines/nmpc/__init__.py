"""Model predictive control of slew, arm and swinging tool at 10 Hz; equations: README.md."""
