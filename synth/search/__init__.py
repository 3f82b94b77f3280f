"""The search for parameters: starts, programmes, polishing, following."""
