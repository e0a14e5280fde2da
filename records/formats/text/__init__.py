"""The one front for text files: all that has to be decided is decided from the whole file, by written rules.

In the order of the data: `source.py` (encoding), `lvm.py` and `lvm_segments.py` (LabVIEW),
`layout.py` and `headings.py` (delimiter, preamble, header,
units), `rows.py` (lines that are rows), `marks.py` (decimals and thousands), `clock_column.py`,
`clock.py`, `clocks.py`, `columns.py`.  Where two
readings are possible the file is refused, with its place and the option that says which (`options.py`).
The file is read three times in blocks: nothing but the numbers stays in memory.
"""

from records.formats.text.options import TextOptions
from records.formats.text.table import read_text

__all__ = ["TextOptions", "read_text"]
