"""Parameters on a page: grouped, with units and meaning, a load on B-splines as forces."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.document import Details
from clutchid.documents.fit_sections import parameter_blocks, parameter_table
from clutchid.documents.tables import ReportTable
from clutchid.estimation import Estimate
from clutchid.model import Load


@pytest.fixture
def on_b_splines(fitted):
    load = Load.on_b_splines(fitted.actuator.load)
    weights = {name: Estimate(1e3, "N", 1.0, 998.0, 1002.0) for name in load.names}
    others = {"P_S@first": Estimate(9e5, "Pa", 1e3, 8.98e5, 9.02e5), "F_C": Estimate(200.0, "N", 2.0, 196.0, 204.0)}
    size = len(weights) + len(others)
    actuator = replace(fitted.actuator, load=load)
    return replace(fitted, actuator=actuator, parameters={**weights, **others}, covariance=np.eye(size))


def test_the_papers_weights_stand_in_the_table(fitted):
    table, fixed = parameter_blocks(fitted)
    assert table.column("name") == ("theta_1", "theta_2", "theta_3")
    assert isinstance(fixed, Details)


def test_a_load_on_b_splines_is_forces_and_its_weights_are_folded(on_b_splines):
    table, load, weights, _fixed = parameter_blocks(on_b_splines)
    assert table.column("name") == ("P_S@first", "F_C")
    assert isinstance(load, ReportTable)
    assert load.title == "Load over position"
    assert weights.summary == f"{len(on_b_splines.actuator.load.names)} load weights"
    assert weights.blocks[0].column("name") == on_b_splines.actuator.load.names


def test_every_number_has_its_meaning_and_its_recording(on_b_splines):
    table = parameter_table(on_b_splines, ["P_S@first", "F_C", "theta_1"])
    assert table.column("meaning") == ("supply pressure, absolute, in first", "Coulomb friction", "weight of the load")


def test_what_a_recording_has_of_its_own_is_not_called_fixed(on_b_splines):
    fixed = parameter_blocks(on_b_splines)[-1].blocks[0].text
    assert "P_S =" not in fixed
    assert "F_C =" not in fixed
    assert "C_vs = " in fixed
