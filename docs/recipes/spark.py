"""Read recordings under Spark: `mapInPandas` gives the bytes of files to clutchid, and gets rows of its table."""

from collections.abc import Iterator

import pandas as pd

import clutchid

#: A calibration that every executor can open, or a folder with one for each vehicle.
CALIBRATION = "/Volumes/fleet/calibrations"

#: Columns of the result, some of those of recordings/.
SCHEMA = (
    "vehicle string, recording string, status string, message string, trust string, shift_mm double, "
    "shift_std_mm double, load_change_percent double, load_5mm_N double, peak_N double, sha256 string"
)


def rows(batches: Iterator[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Rows for batches with `path` and `content`, as the format binaryFile has them."""
    names = [column.split()[0] for column in SCHEMA.split(", ")]
    for batch in batches:
        files = zip(batch["path"], batch["content"], strict=True)
        read = (clutchid.recording_row(bytes(content), path, CALIBRATION) for path, content in files)
        yield pd.DataFrame([[row[name] for name in names] for row in read], columns=names)


if __name__ == "__main__":
    from pyspark.sql import SparkSession

    spark = SparkSession.builder.getOrCreate()
    files = spark.read.format("binaryFile").option("recursiveFileLookup", "true").load("s3://bucket/fleet")
    files.select("path", "content").mapInPandas(rows, SCHEMA).write.mode("append").saveAsTable("clutch.recordings")
