"""Samples as they arrive: from standard input, a growing file or a bus, to blocks of a recording in SI.

`feed` has where raw items come from, `text` and `json_lines` turn bytes into rows, `streams` picks channels by the map,
`order` sorts what is late, and `arrival` joins the streams to blocks of a recording.
"""
