"""Channel maps: which channel of a file is which quantity, as a file, a proposal, and applied."""
