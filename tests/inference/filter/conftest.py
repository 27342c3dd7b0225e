"""Recordings and problems of the filter."""

from fixtures.filter_recordings import duties, plant, problem_of, recorded_by  # noqa: F401
