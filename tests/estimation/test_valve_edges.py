"""A valve whose dead band is as wide as its full opening: refused in a file, never reached by a search."""

import pytest

from clutchid import fit
from clutchid.cli import main
from clutchid.errors import ParameterError
from clutchid.measurements import write


@pytest.mark.parametrize("valve", ["vs", "ve"])
@pytest.mark.parametrize("command", ["fit", "simulate"])
def test_a_file_in_which_a_valve_opens_at_once_is_refused(valve, command, drive, tmp_path, capsys):
    write(drive.slice(0, 2000), tmp_path / "run.csv")
    start = tmp_path / "start.toml"
    start.write_text(f"[parameters]\nR_0{valve} = 0.5\nR_1{valve} = 0.5\n")
    files = ["--start", start] if command == "fit" else ["--parameters", start, "--out", tmp_path / "out.csv"]
    with pytest.raises(SystemExit) as ended:
        main([command, str(tmp_path / "run.csv"), *map(str, files)])
    assert ended.value.code == 2
    expected = f"R_0{valve} = 0.5 must be below R_1{valve} = 0.5: a valve opens with rising duty cycle."
    assert expected in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("valve", ["vs", "ve"])
def test_a_search_whose_bounds_let_both_ends_meet_keeps_them_apart(valve, truth, drive):
    names = (f"R_0{valve}", f"R_1{valve}")
    near = truth.replace({names[0]: 0.49, names[1]: 0.5})
    found = fit(drive, near, free=names, bounds={names[0]: (0.0, 1.0), names[1]: (0.05, 2.0)})
    low, high = (found.actuator.value(name) for name in names)
    assert found.status != "failed"
    assert low < high


def test_bounds_that_start_a_search_with_the_ends_exchanged_are_refused(truth, drive):
    with pytest.raises(ParameterError, match=r"R_0vs = 0.6 must be below R_1vs = 0.5"):
        fit(drive, truth, free=("R_0vs", "R_1vs"), bounds={"R_0vs": (0.6, 0.9), "R_1vs": (0.3, 0.5)})
