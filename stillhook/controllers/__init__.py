"""From a name or a design to a controller in time.

In come names, designs, objects and functions of the case; out go controllers, or recipes for them
that another process can follow and a store can keep.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .contenders import ALL, CONTENDERS, DEFAULTS, DESIGNED, Contender, contenders_of, line_up
    from .in_c import with_c, with_c_if_any
    from .named import CONTROLLER_TEXTS, controller_of
    from .recipe import Recipe, recipe_from, recipe_of
    from .stored_design import StoredDesign, design_law
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
