"""Readers: one file, data frame or dict of arrays → `Measurements`.

What a reader cannot know it asks for; it guesses no unit, no quantity and no convention.
"""

from fitmat.formats.options import ALLOWED as ALLOWED
from fitmat.formats.reader import Source as Source
from fitmat.formats.reader import read as read
from fitmat.formats.writing import write as write
