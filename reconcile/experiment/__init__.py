"""The experiment that would settle a doubt: chosen within the limits, with its predicted margin."""
