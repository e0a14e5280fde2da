"""The effects that a case can hide: names of the contract, own parameters, sizes and start values."""
