"""Recordings and problems of the filter."""

from fixtures.filter_recordings import duties, plant, recorded_by, task_of  # noqa: F401
