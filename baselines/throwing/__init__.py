"""Throws: when to open the grab so that its load lands at a place within or beyond reach."""
