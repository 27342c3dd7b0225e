"""`observe` while a recording arrives: ended by signals, results as they arise, files that survive any fault."""
