"""The guarded reader process: foreign files are opened by libraries in a process of their own.

A library may end its process on a damaged file, never return, or unpack a small file to gigabytes. All that then ends
is the reader process, a `clutchid.processes.Worker`, and the user gets one sentence. `remote.guarded_source` is what
the rest of `io` calls; `process` asks the reader, `service` is what runs in it, and `messages` is what the two say to
each other: JSON, and arrays of numbers, so that nothing that comes from a file is ever executed.
"""
