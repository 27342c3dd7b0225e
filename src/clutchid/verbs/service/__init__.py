"""`observe` as a service: signals end it, results are published while they come, and files are whole whatever fails."""
