"""From a name or a design to a controller in time.

In come names, designs, objects and functions of the case; out go controllers, or recipes for them
that another process can follow and a store can keep.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .contenders import CONTENDERS as CONTENDERS
    from .contenders import DEFAULTS as DEFAULTS
    from .contenders import Contender as Contender
    from .contenders import contenders_of as contenders_of
    from .named import PREDICTIVE as PREDICTIVE
    from .named import controller_of as controller_of
    from .named import known_controllers as known_controllers
    from .recipe import Recipe as Recipe
    from .recipe import recipe_from as recipe_from
    from .recipe import recipe_of as recipe_of
    from .stored_design import StoredDesign as StoredDesign
    from .stored_design import design_law as design_law
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
