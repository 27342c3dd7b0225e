"""`observe` as a service: ended by signals, with results published as they arise and files that survive any fault."""
