"""From a name or a design to a controller in time."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .contenders import CONTENDERS as CONTENDERS
    from .contenders import DEFAULTS as DEFAULTS
    from .contenders import Contender as Contender
    from .contenders import contenders_of as contenders_of
    from .controllers import PREDICTIVE as PREDICTIVE
    from .controllers import controller_by_name as controller_by_name
    from .controllers import known_controllers as known_controllers
    from .makers import given as given
    from .stored_design import StoredDesign as StoredDesign
    from .stored_design import design_law as design_law
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
