"""Work on many recordings: processes that share it, and the files of a virtual fleet."""
