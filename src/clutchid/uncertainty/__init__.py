"""What is known before the data, what the data add, and how uncertain the result is."""
