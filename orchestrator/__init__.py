"""The co-simulation master: a system description in, a run record out."""
