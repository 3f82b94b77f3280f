"""Words, tables and numbers as people read them."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound_text import bound_cell as bound_cell
    from .bound_text import bound_figures as bound_figures
    from .bound_text import bound_sentence as bound_sentence
    from .bound_text import bounds_note as bounds_note
    from .folder import OutputFolder as OutputFolder
    from .folder import folder_name as folder_name
    from .hook_words import heading_text as heading_text
    from .hook_words import heading_words as heading_words
    from .hook_words import sea_words as sea_words
    from .hook_words import vessel_words as vessel_words
    from .motion import PAYLOAD as PAYLOAD
    from .motion import MotionView as MotionView
    from .motion import highest as highest
    from .quantities import count as count
    from .quantities import decibels as decibels
    from .quantities import duration as duration
    from .quantities import number as number
    from .quantities import percent as percent
    from .quantities import quantity as quantity
    from .quantities import scale as scale
    from .style import AFTER as AFTER
    from .style import BEFORE as BEFORE
    from .style import BROKEN as BROKEN
    from .style import DRUM as DRUM
    from .style import HOOK as HOOK
    from .style import REFERENCE as REFERENCE
    from .style import annotate as annotate
    from .style import headline as headline
    from .style import new_figure as new_figure
    from .style import picture as picture
    from .style import styled as styled
    from .style import typeset as typeset
    from .summary import AT_LEAST as AT_LEAST
    from .summary import LimitRow as LimitRow
    from .summary import command_text as command_text
    from .summary import effect as effect
    from .summary import facts as facts
    from .summary import gain_rows as gain_rows
    from .summary import has_gains as has_gains
    from .summary import limit_rows as limit_rows
    from .summary import margin_rows as margin_rows
    from .summary import motion_rows as motion_rows
    from .summary import required_rows as required_rows
    from .terminal import Progress as Progress
    from .terminal import commands as commands
    from .terminal import console as console
    from .terminal import pairs as pairs
    from .terminal import progress as progress
    from .terminal import show_design as show_design
    from .terminal import table_of as table_of
    from .terminal import told_once as told_once
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
