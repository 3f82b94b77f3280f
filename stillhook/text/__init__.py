"""Tables, reports, numbers and figures as people read them.

What came of a study goes in as a `Report` or a `Table`, a number with its unit; out come text for
the terminal, Markdown, CSV or JSON, pictures, and files in a folder, each whole or not at all.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .encoding import take_any_text, write_json
    from .folder import OutputFolder, check_own, folder_name, pictures
    from .fonts import Face, font_face
    from .hook_words import heading_text, heading_words, sea_words, vessel_words
    from .images import characters_of, inline_svg, picture
    from .quantities import (
        count,
        decibels,
        delay_margin,
        duration,
        largest_in,
        listed,
        number,
        percent,
        quantity,
        scale,
    )
    from .style import (
        AFTER,
        BEFORE,
        BROKEN,
        DASHED,
        DRUM,
        HOOK,
        REFERENCE,
        Axes,
        Figure,
        annotate,
        drawn,
        headline,
        logarithmic,
        new_figure,
        panel,
        styled,
        typeset,
        untypeset,
    )
    from .table import (
        Bar,
        Column,
        Drawing,
        Item,
        Listing,
        Report,
        ReportSection,
        Sentence,
        Table,
        Written,
        columns,
        csv_text,
        data_table,
        json_data,
        json_text,
        markdown,
        pairs,
        remarks,
    )
    from .terminal import Progress, commands, console, progress, show, told_once
    from .watching import show_progress
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
