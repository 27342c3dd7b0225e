"""Work on many recordings: jobs, store and tables, also on a Dask scheduler, and the files of a virtual fleet."""
