"""Keeping of results: journals, pools of workers, digests of code.

In come a question and tasks; out go answers, whichever process gave them, files from which work
goes on after it was stopped, and a digest of the code behind the numbers.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .cluster import Cluster as Cluster
    from .digest import code_digest as code_digest
    from .digest import versions as versions
    from .journal import Journal as Journal
    from .journal import question_in as question_in
    from .pool import POLL as POLL
    from .pool import Alone as Alone
    from .pool import Died as Died
    from .pool import Pool as Pool
    from .pool import usable_cores as usable_cores
    from .processes import Processes as Processes
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
