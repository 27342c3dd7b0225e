"""The request of a fit, and that of one of its recordings alone."""

from clutchid.estimation.request import FitRequest
from clutchid.inference.uncertainty.coordinates import Prior


def test_alone_a_recording_has_its_own_and_the_shared_parameters_and_no_checks():
    names = ("load", "P_S@day 1", "P_S@day 2", "C_vs", "F_C@EACH")
    limits, prior = (1.0, 2.0), Prior(1.0, 0.1)
    shared = ("C_vs", "P_S@day 1", "P_S@day 2")
    whole = FitRequest(
        free=names, bounds=dict.fromkeys(shared, limits), priors=dict.fromkeys(shared, prior), profile=("C_vs",),
        bootstrap=20,
    )  # fmt: skip
    alone = whole.alone("day 2")
    assert alone.free == ("load", "P_S@day 2", "C_vs", "F_C@EACH")
    assert alone.bounds == dict.fromkeys(("C_vs", "P_S@day 2"), limits)
    assert alone.priors == dict.fromkeys(("C_vs", "P_S@day 2"), prior)
    assert not alone.checks
    assert FitRequest(free=names).alone("day 3").free == ("load", "C_vs", "F_C@EACH")
