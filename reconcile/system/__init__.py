"""A system of several models against recordings of the whole: one search for each part, one answer."""
