"""Every table and figure of the paper, made again on three plants: `slewright reproduce`."""
