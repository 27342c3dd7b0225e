"""Append the new rows of a fleet to a Delta table: python append_to_delta.py RUN s3://lake/recordings

Each part is one transaction with its name, so that a run that was killed is repeated and doubles nothing. Rows that
another part has brought, because small parts of a date were folded, are left out by their key.
"""

import sys
from pathlib import Path

import polars as pl
from deltalake import CommitProperties, DeltaTable, Transaction, write_deltalake
from deltalake.exceptions import TableNotFoundError

KEY = ["vehicle", "recording", "written_at"]


def append(run: Path, table: str) -> int:
    """Append all parts of a run that the table does not know; the number of new rows."""
    count = 0
    for part in sorted(run.glob("recordings/date=*/part-*.parquet")):
        rows = pl.read_parquet(part, hive_partitioning=True).with_columns(pl.col("date").cast(pl.Date))
        try:
            existing = DeltaTable(table)
        except TableNotFoundError:
            existing = None
        if existing is not None:
            if existing.transaction_version(part.stem) is not None:
                continue
            rows = rows.join(pl.from_arrow(existing.to_pyarrow_table(columns=KEY)), on=KEY, how="anti")
        once = CommitProperties(app_transactions=[Transaction(part.stem, 1)])
        write_deltalake(table, rows.to_arrow(), mode="append", schema_mode="merge", commit_properties=once)
        count += rows.height
    return count


if __name__ == "__main__":
    print(append(Path(sys.argv[1]), sys.argv[2]), "rows appended")
