"""What is learned from recordings: data collection, slew networks, policies; runs with PyTorch."""
