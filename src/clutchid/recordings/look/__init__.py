"""What is in a file, even if it cannot be read as a recording."""
