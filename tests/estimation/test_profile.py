"""Profile-likelihood intervals: what the cost itself says of one number, where all others follow."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.estimation import checks as module
from clutchid.estimation.checks import (
    MAX_EVALUATIONS,
    MAX_HALF_WIDTHS,
    NONQUADRATIC_SHARE,
    ROOT_TOLERANCE,
    is_nonquadratic,
    profile_curve,
)
from clutchid.estimation.posterior import parameter_uncertainty
from clutchid.estimation.result import QUANTILE
from clutchid.inference.smoother.problem import condense
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.smoother.search import STAGES_FROM_CALIBRATION, project, search
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.numerics.failure import Failure

pytestmark = pytest.mark.slow

#: The data determine friction, sensor lag and gas temperature, but not the far stop, which the piston does not reach.
NAMES = ("F_C", "tau_y", "T_w", "K_stop")


def profile_interval(*arguments):
    """Ends of the interval of a profile, or why there is none."""
    curve = profile_curve(*arguments)
    return curve if isinstance(curve, Failure) else (curve.low, curve.high)


@pytest.fixture(scope="module")
def log(plant, recorded_by):
    return recorded_by(plant, seconds=4.0, driven=1)


@pytest.fixture(scope="module")
def problem(plant, log, problem_of):
    return problem_of([log], plant, NAMES)


@pytest.fixture(scope="module")
def solution(problem, starts_of):
    return search(problem, np.zeros(len(NAMES)), starts_of(problem), STAGES_FROM_CALIBRATION)


@pytest.fixture(scope="module")
def uncertain(problem, solution):
    return parameter_uncertainty(problem, solution, None)


@pytest.fixture(scope="module")
def profiled(problem, solution, uncertain):
    """The interval of every number."""
    return {name: profile_interval(problem, solution, uncertain, name) for name in NAMES}


@pytest.fixture(scope="module")
def quadratic(problem, solution, uncertain):
    """The interval of every number that the covariance says."""
    half = QUANTILE * np.sqrt(np.diag(uncertain.matrix))
    ends = zip(problem.coordinates, solution.x - half, solution.x + half, strict=True)
    return {c.name: (c.si(low), c.si(high)) for c, low, high in ends}


def half(problem, name, interval):
    """Half width of an interval as a coordinate."""
    c = problem.coordinates[problem.names.index(name)]
    return (c.of(interval[1]) - c.of(interval[0])) / 2


def test_a_curve_has_every_evaluation_and_rises_to_its_ends_on_both_sides(problem, solution, uncertain):
    curve = profile_curve(problem, solution, uncertain, "F_C")
    assert curve.shape == "bounded"
    assert np.all(np.diff(curve.values) > 0.0)
    least = int(np.argmin(curve.distances))
    assert curve.values[least] == pytest.approx(problem.si(solution.x)[0])
    assert np.all(np.diff(curve.distances[: least + 1]) < 0.0)
    assert np.all(np.diff(curve.distances[least:]) > 0.0)
    assert np.interp(curve.high, curve.values, curve.distances) == pytest.approx(QUANTILE, rel=0.05)


@pytest.mark.parametrize("name", ["tau_y", "T_w"])
def test_where_the_cost_is_nearly_quadratic_the_interval_is_that_of_the_covariance(problem, profiled, quadratic, name):
    # an end is taken where the root of the cost is within NEAR of its quantile; three times as much for the slight bend
    wanted = half(problem, name, quadratic[name])
    c = problem.coordinates[problem.names.index(name)]
    for end, same in zip(profiled[name], quadratic[name], strict=True):
        assert c.of(end) == pytest.approx(c.of(same), abs=4 * ROOT_TOLERANCE * wanted)
    assert not is_nonquadratic(quadratic[name], profiled[name])


@pytest.fixture(scope="module")
def costs(problem, solution, profiled):
    """How much the cost has grown at both ends of a number that is no longer free at all but in the actuator."""

    def grown(name):
        place = NAMES.index(name)
        others = [i for i in range(len(NAMES)) if i != place]
        c, left = problem.coordinates[place], tuple(problem.coordinates[i] for i in others)

        def cost(value, start):
            without = replace(problem, coordinates=left, actuator=problem.actuator.replace({name: value}))
            there = project(without, start.x, start.at.X, lambda *_: None)
            # what the prior says of the number that is not free here
            return there, there.at.cost + c.of(value) ** 2

        start, _ = cost(c.si(solution.x[place]), replace(solution, x=solution.x[others]))
        _, least = cost(c.si(solution.x[place]), start)
        return [cost(end, start)[1] - least for end in profiled[name]]

    return grown


@pytest.mark.parametrize("name", ["F_C", "T_w", "K_stop"])
def test_at_the_ends_everything_else_free_the_cost_has_grown_as_much_as_defined(
    problem, solution, uncertain, costs, name
):
    place = NAMES.index(name)
    R = condense(problem, solution.at)[0][:-1, :-1]
    deviation = np.sqrt(np.linalg.inv(R.T @ R)[place, place])
    roots = np.sqrt(costs(name)) * deviation / np.sqrt(uncertain.matrix[place, place])
    # tolerance of the root; for a parameter with its prior alone, whose end costs 3.5, also CONVERGED_GAIN, 1.4 %
    assert roots == pytest.approx(QUANTILE, rel=ROOT_TOLERANCE + 0.015)


def test_where_data_rule_their_dispersion_counts_and_what_is_considered_adds(problem, solution, uncertain, costs):
    place = NAMES.index("F_C")
    noise, total = np.linalg.norm(uncertain.noise_root[place]), np.sqrt(uncertain.matrix[place, place])
    assert total > 1.1 * noise, "what is taken as known is a part of what is not known of the friction"
    # the priors of all parameters have no dispersion, which is a per cent here
    assert np.sqrt(np.array(costs("F_C")) / dispersion(problem, solution.at)) * noise / total == pytest.approx(
        QUANTILE, rel=ROOT_TOLERANCE + 0.02
    )


def test_a_number_that_the_data_do_not_tell_has_the_interval_of_its_prior(problem, profiled):
    c = problem.coordinates[NAMES.index("K_stop")]
    # NEAR, and 1.4 % that a search leaves
    assert [c.of(end) for end in profiled["K_stop"]] == pytest.approx([-QUANTILE, QUANTILE], rel=ROOT_TOLERANCE + 0.015)


def test_an_interval_holds_its_estimate_in_si_and_what_is_positive_stays_so(problem, solution, profiled):
    for name, value in zip(NAMES, problem.si(solution.x), strict=True):
        low, high = profiled[name]
        assert low < value < high
        assert low > 0.0
    assert profiled["F_C"] == pytest.approx((200.0, 200.0), rel=0.15), "newtons, within what friction drifts by"
    assert profiled["K_stop"][1] / 3e7 > 3e7 / profiled["K_stop"][0] * 0.8, "symmetric in the logarithm"


def bounded(problem, name, **limits):
    """The problem with other bounds of one number."""
    return replace(
        problem, coordinates=tuple(replace(c, **limits) if c.name == name else c for c in problem.coordinates)
    )


def test_a_bound_inside_the_interval_is_its_end(problem, solution, uncertain, profiled):
    bound = (profiled["F_C"][0] + problem.si(solution.x)[0]) / 2
    low, high = profile_interval(bounded(problem, "F_C", low=bound), solution, uncertain, "F_C")
    assert low == bound
    assert high == pytest.approx(profiled["F_C"][1], rel=1e-3)


def test_an_estimate_that_is_pressed_to_its_bound_ends_there_and_is_narrower_to_the_other_side(
    plant, log, problem_of, solution
):
    limits, priors = {"F_C": (210.0, 1e3)}, {"F_C": Prior(220.0, 88.0)}
    problem = problem_of([log], plant, NAMES, bounds=limits, priors=priors)
    pressed = project(problem, np.clip(solution.x, *problem.bounds()), solution.at.X, lambda *_: None)
    assert problem.si(pressed.x)[0] == pytest.approx(210.0)
    uncertain = parameter_uncertainty(problem, pressed, None)
    low, high = profile_interval(problem, pressed, uncertain, "F_C")
    c = problem.coordinates[0]
    assert low == pytest.approx(210.0, rel=1e-12)
    assert 210.0 < high < c.si(float(pressed.x[0]) + QUANTILE * np.sqrt(uncertain.matrix[0, 0]))


def test_an_unknown_name_is_refused_with_those_that_are_free(problem, solution, uncertain):
    with pytest.raises(ParameterError, match=r"C_r is not a free parameter of this fit; choose one of F_C, tau_y"):
        profile_interval(problem, solution, uncertain, "C_r")


class Valley:
    """In place of `project`: a cost that depends on the friction alone, as `root` of the quadratic ends' half width.

    ``root(u)`` is by how many quantiles the cost has grown u half widths away from the estimate, or why it has not.
    """

    def __init__(self, root, solution, uncertain):
        self.root, self.solution, self.uncertain, self.tried = root, solution, uncertain, []

    def __call__(self, problem, x, X, tell):
        width = QUANTILE * np.sqrt(self.uncertain.matrix[0, 0])
        u = (x[0] - self.solution.x[0]) / width
        self.tried.append(u)
        root = self.root(u)
        if isinstance(root, Failure):
            return root
        R = condense(problem, self.solution.at)[0][:-1, :-1]
        search = np.linalg.norm(np.linalg.inv(R)[0])
        more = np.sign(root) * (root * width / search) ** 2
        return replace(self.solution, x=x, at=replace(self.solution.at, cost=self.solution.at.cost + more))


@pytest.fixture
def ends(problem, solution, uncertain, monkeypatch):
    """Ends of the interval of the friction in half widths of the covariance, and where the cost was tried."""

    def find(root):
        valley = Valley(root, solution, uncertain)
        monkeypatch.setattr(module, "project", valley)
        answer = profile_interval(problem, solution, uncertain, "F_C")
        if isinstance(answer, Failure):
            return answer, valley.tried
        c = problem.coordinates[0]
        width = QUANTILE * np.sqrt(uncertain.matrix[0, 0])
        return [(c.of(end) - solution.x[0]) / width for end in answer], [u for u in valley.tried if abs(u) > 1e-9]

    return find


def test_on_a_parabola_one_evaluation_a_side_is_enough(ends):
    assert ends(abs) == ([pytest.approx(-1.0), pytest.approx(1.0)], [pytest.approx(-1.0), pytest.approx(1.0)])


@pytest.mark.parametrize(
    ("root", "end"),
    [(lambda u: 3 * u, 1 / 3), (lambda u: 0.4 * u, 2.5), (np.sqrt, 1.0), (lambda u: u**4 / 16, 2.0),
     (lambda u: 2 * u**3, 2 ** (-1 / 3)), (lambda u: np.sqrt(u / 3), 3.0)],
)  # fmt: skip
def test_a_bent_cost_is_followed_on_both_sides_in_a_bracket(ends, root, end):
    solution, tried = ends(lambda u: root(abs(u)))
    # NEAR in the cost, and what the last line through two points leaves
    assert [root(abs(u)) for u in solution] == pytest.approx([1.0, 1.0], rel=2 * ROOT_TOLERANCE)
    assert solution == pytest.approx([-end, end], rel=2 * ROOT_TOLERANCE / 0.5)
    for side in ([u for u in tried if u > 0], [-u for u in tried if u < 0]):
        assert len(side) <= MAX_EVALUATIONS
        for i, u in enumerate(side):
            assert u > max((v for v in side[:i] if root(v) < 1), default=0.0)
            assert u < min((v for v in side[:i] if root(v) > 1), default=np.inf)


TOO_LONG = Failure("the step is too long.")


@pytest.mark.parametrize(
    ("root", "wanted"),
    [
        (lambda u: -4 * u if u < 0 else 0.5 * u, [-0.25, 2.0]),
        (lambda u: -0.3 if 0.5 < u < 1.5 else abs(u) / 2, [-2.0, 2.0]),
        (lambda u: TOO_LONG if u > 0.9 else abs(u) / 0.6, [-0.6, 0.6]),
        (lambda u: TOO_LONG if u > 0.01 else 2 * abs(u), [-0.5, 1.0]),
    ],
    ids=[
        "side by side",
        "cheaper than the estimate",
        "failing counts as too far",
        "failing side as the covariance says",
    ],
)
def test_ends_are_found_where_the_cost_is_no_parabola(ends, root, wanted):
    assert ends(root)[0] == pytest.approx(wanted, rel=2 * ROOT_TOLERANCE)


@pytest.mark.parametrize(
    ("root", "shape"),
    [
        (abs, "bounded"),
        (lambda u: 0.0, "flat"),
        (lambda u: max(u, 0.0), "open below"),
        (lambda u: max(-u, 0.0), "open above"),
    ],
    ids=["parabola", "flat", "open below", "open above"],
)
def test_the_shape_says_where_the_cost_does_not_grow(problem, solution, uncertain, monkeypatch, root, shape):
    monkeypatch.setattr(module, "project", Valley(root, solution, uncertain))
    assert profile_curve(problem, solution, uncertain, "F_C").shape == shape


def test_what_never_costs_enough_ends_after_four_half_widths(ends):
    solution, tried = ends(lambda u: 0.0)
    assert solution == pytest.approx([-MAX_HALF_WIDTHS, MAX_HALF_WIDTHS])
    assert max(map(abs, tried)) == pytest.approx(MAX_HALF_WIDTHS)


def test_where_neither_side_can_be_simulated_there_is_no_interval(ends):
    answer, tried = ends(lambda u: TOO_LONG)
    assert answer is TOO_LONG
    assert len([u for u in tried if abs(u) > 1e-9]) <= 2 * MAX_EVALUATIONS


def test_the_covariance_misleads_where_an_end_is_off_by_a_fifth_of_the_half_width():
    assert not is_nonquadratic((150.0, 250.0), (150.0 + 50 * NONQUADRATIC_SHARE * 0.99, 250.0))
    assert is_nonquadratic((150.0, 250.0), (150.0 + 50 * NONQUADRATIC_SHARE * 1.01, 250.0))
    assert is_nonquadratic((150.0, 250.0), (150.0, 250.0 - 50 * NONQUADRATIC_SHARE * 1.01))
    assert is_nonquadratic((150.0, 250.0), (150.0, 250.0 + 50 * NONQUADRATIC_SHARE * 1.01))
