"""Signed archives of bundles, the keys that are trusted, and a machine's store with its last good bundle."""
