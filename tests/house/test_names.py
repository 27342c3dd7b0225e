"""One meaning a name, and arguments that a reader can keep apart.

A public name of a module is that of another module only where both are one interface.
"""

import ast
from collections import defaultdict

from fixtures.trees import source_nodes, source_trees

#: Names of several modules, by the interface that these modules share.
INTERFACES = {
    "a verb of Python, its command, and its task on the page": (
        "calibrate", "cut", "drive", "estimate", "export", "fit", "fleet", "friction", "look", "observe",
        "simulate", "track",
    ),
    "the page's record of it, reached as `records.NAME`": ("Export", "Observation", "Recording"),
    "a program": ("app", "main"),
    "a command on saved loads, and the comparison of samples": ("compare",),
    "a format of files": ("open_file", "save"),
    "a method of a fit": ("evaluated", "problem_of", "result", "rows", "search", "start_values"),
    "processes of one machine or of a cluster": ("results",),
    "rows of a document": ("rows_of",),
    "a law of the model, and that of the virtual truck, which may not know it": (
        "P_N", "T_N", "acceleration", "bearing_force", "coulomb_force", "deflection_rate", "heat_flow", "orifice_flow",
        "pressure_rate", "stop_force", "stribeck_force", "wall_area",
    ),
    "a part of the virtual truck": ("air", "crossing", "forces", "heat", "rates", "temperature"),
    "a kernel, and the function that calls it": ("downweight_outliers", "eliminate", "lag_coefficients"),
    "a search of the smoother": ("CONVERGED_GAIN", "MAX_STEPS"),
    "a word of the printer of kernels": ("Rows", "function", "read"),
}  # fmt: skip


def public_names(tree):
    """Functions, classes and constants of a module that do not begin with an underscore."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        yield from (name.id for target in targets if target for name in ast.walk(target) if isinstance(name, ast.Name))


def test_a_name_has_one_meaning():
    homes = defaultdict(set)
    for file, tree in source_trees().items():
        for name in public_names(tree):
            homes[name].add(file)
    several = {name for name, files in homes.items() if len(files) > 1 and not name.startswith("_")}
    interfaces = {name for names in INTERFACES.values() for name in names}
    assert {name: sorted(homes[name]) for name in several - interfaces} == {}
    assert interfaces - several == set(), "take them from the table"


#: Formulas, whose arguments are the letters in them, what the printer of kernels makes of a system, and kernels that
#: take what they fill.
FORMULAS = {"acceleration", "balanced_pressure", "diaphragm_force", "pressure_rate", "request"}
LONG = {*FORMULAS, "step_function", "correct", "take_in", "take_in_all"}


def test_no_function_but_a_formula_has_more_than_eight_arguments_by_position():
    functions = (node for _, node in source_nodes() if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    long = {node.name for node in functions if len([*node.args.posonlyargs, *node.args.args]) > 8}
    assert long == LONG
