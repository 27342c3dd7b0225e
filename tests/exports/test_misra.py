"""The sources of an export against cppcheck's addon for MISRA C: no rule is reported that has no reason."""

import re
import subprocess
from collections import Counter

import pytest

from clutchid.exports.c99 import CStyle
from clutchid.exports.misra import CHECKER, FINDINGS
from clutchid.model import Actuator, Load
from clutchid.observer import observer
from fixtures.export_c import write_sources
from fixtures.programs import path_of

pytestmark = [pytest.mark.slow, pytest.mark.needs("cppcheck")]


def reported(folder):
    """Places by rule and source, as cppcheck finds them in the sources of a folder."""
    command = [path_of("cppcheck"), *CHECKER[1].split()[1:], "--suppress=missingIncludeSystem", "-q"]
    process = subprocess.run(
        [*command, "--template={file} {id}", *folder.glob("*.c")], capture_output=True, text=True, check=True
    )
    return Counter(re.findall(r"clutch(\w*)\.[ch] misra-c2012-(\d+\.\d+)", process.stderr))


#: Places at most by source and rule.
ALLOWED = {
    (source.removeprefix("NAME"), rule): places
    for rule, finding in FINDINGS.items()
    for source, places in finding.places.items()
}


@pytest.mark.parametrize(
    ("method", "style"),
    [("joint", CStyle()), ("joint", CStyle(real="double", rates="two")), ("states", CStyle()), ("paper", CStyle())],
    ids=lambda value: value if isinstance(value, str) else f"{value.real}-{value.rates}",
)
def test_only_rules_with_a_reason_are_reported(plant, tmp_path, method, style):
    paper = Actuator(plant.parameters, Load((9.0e5, -0.3e5, 0.6e5)), "isothermal")
    write_sources(observer(paper if method == "paper" else plant, method), style, tmp_path / "src")
    places = reported(tmp_path / "src")
    assert places, "the addon runs"
    assert not {at: count for at, count in places.items() if count > ALLOWED.get(at, 0)}


def test_a_rule_without_a_reason_is_found(plant, tmp_path):
    write_sources(observer(plant, "states"), CStyle(), tmp_path / "src")
    with (tmp_path / "src" / "clutch.c").open("a") as source:
        source.write("\nint spoiled(int a, int b);\nint spoiled(int a, int b)\n{\n    return a + b * a;\n}\n")
    assert ("", "12.1") in set(reported(tmp_path / "src")) - set(ALLOWED)
