"""A test pack for SSP importers: small FMUs and systems, one for each feature and for each error.

models.py, terminals.py             the FMUs: variables and terminals as data
description.py, kit.py              modelDescription.xml; compiled from c/
render.py                           the parts of an SSD as text
cases/                              what is tested, as data
pack.py                             the pack on disk: an .ssp and what is expected of it, for each case
verdict.py, ours.py                 a case on this project's own orchestrator
masters.py, compare.py, page.py     the same on other people's masters, and the page about that
"""
