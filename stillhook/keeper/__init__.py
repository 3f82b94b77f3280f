"""Keeping of results: journals, pools of workers, digests of code.

In come a question and tasks; out go answers, whichever process gave them, files from which work
goes on after it was stopped, and a digest of the code behind the numbers.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .channel import close, how_it_ended, receive, send, served, started
    from .cluster import Cluster
    from .digest import code_digest, versions
    from .journal import Journal, question_in
    from .pool import POLL, Alone, Died, Pool, failure, usable_cores
    from .processes import Processes
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
