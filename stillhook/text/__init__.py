"""Tables, reports, numbers and figures as people read them.

What came of a study goes in as a `Report` or a `Table`, a number with its unit; out come text for
the terminal, Markdown, CSV or JSON, pictures, and files in a folder, each whole or not at all.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .folder import OutputFolder as OutputFolder
    from .folder import folder_name as folder_name
    from .hook_words import heading_text as heading_text
    from .hook_words import heading_words as heading_words
    from .hook_words import sea_words as sea_words
    from .hook_words import vessel_words as vessel_words
    from .quantities import count as count
    from .quantities import decibels as decibels
    from .quantities import duration as duration
    from .quantities import listed as listed
    from .quantities import number as number
    from .quantities import percent as percent
    from .quantities import quantity as quantity
    from .quantities import scale as scale
    from .style import AFTER as AFTER
    from .style import BEFORE as BEFORE
    from .style import BROKEN as BROKEN
    from .style import DASHED as DASHED
    from .style import DRUM as DRUM
    from .style import HOOK as HOOK
    from .style import REFERENCE as REFERENCE
    from .style import annotate as annotate
    from .style import drawn as drawn
    from .style import headline as headline
    from .style import logarithmic as logarithmic
    from .style import new_figure as new_figure
    from .style import panel as panel
    from .style import picture as picture
    from .style import styled as styled
    from .style import typeset as typeset
    from .table import Bar as Bar
    from .table import Column as Column
    from .table import Drawing as Drawing
    from .table import Item as Item
    from .table import Report as Report
    from .table import ReportSection as ReportSection
    from .table import Table as Table
    from .table import Written as Written
    from .table import columns as columns
    from .table import csv_text as csv_text
    from .table import data_table as data_table
    from .table import json_data as json_data
    from .table import json_text as json_text
    from .table import markdown as markdown
    from .table import pairs as pairs
    from .table import remarks as remarks
    from .terminal import Progress as Progress
    from .terminal import commands as commands
    from .terminal import console as console
    from .terminal import progress as progress
    from .terminal import show as show
    from .terminal import terminal_text as terminal_text
    from .terminal import told_once as told_once
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
