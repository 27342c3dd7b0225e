"""Samples as they arrive: from standard input or a bus, to blocks of a recording in SI.

`feed` has where raw items come from, `text` and `bus` turn these into samples of the channels of the map,
`order` sorts what is late, and `arrival` joins the streams to blocks of a recording.
"""
