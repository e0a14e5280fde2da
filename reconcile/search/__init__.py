"""Which effects the recordings ask for: screened, fitted in sets, searched."""
