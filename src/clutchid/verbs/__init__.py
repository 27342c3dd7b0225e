"""Verbs: one recipe each, from recordings and a request to a result, for Python, command line, page and fleets.

A verb reads and checks its recordings as `clutchid.verbs.reading` says, so that the same input gives the same numbers
and the same sentences through every interface.
"""
