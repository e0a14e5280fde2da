"""Recordings as runs, dealt into parts; what is wrong with them."""
