"""The application with all its commands, in the order in which help lists them.

It holds none itself.
"""

from fitmat.cli import commands as commands  # isort: skip
from fitmat.cli import several as several  # isort: skip
from fitmat.cli import afterwards as afterwards  # isort: skip
from fitmat.cli.entry import app as app
