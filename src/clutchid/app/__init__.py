"""The local web page: a server on this machine, the jobs that it starts, and the page in ``static/``.

Whatever is computed runs in a process of its own (`clutchid.app.worker`) and calls what the command line calls. The
server keeps the state, so that a page that is loaded again, or a second one, shows the same.
"""
