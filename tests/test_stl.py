"""Temporal logic: our kernels against rtamt, formulas that are refused, and requirements against scores on clear cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from usv_gym.colregs.oracle import robustness
from usv_gym.colregs.requirements import read_requirements, requirement
from usv_gym.colregs.signals import NAMES
from usv_gym.colregs.stl import compile_formula
from usv_gym.colregs.stl_kernels import robustness as kernel_robustness
from usv_gym.config import ConfigError
from usv_gym.jit import kernel

VARIABLES = ("a", "b", "c")


@kernel
def run(ops, arguments, values, n, stack, queue):
    kernel_robustness(ops, arguments, values, n, stack, queue)


def ours(text, values, dt=1.0):
    program = compile_formula(text, VARIABLES)
    n = values.shape[1]
    stack = np.zeros((program.depth + 1, n))
    run(program.ops, program.in_samples(dt), values, n, stack, np.zeros((3, n)))
    return stack[0]


# --- formulas by hand ------------------------------------------------------------------------------------------------
RAMP = np.array([[1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0], [0.0, -1.0, 5.0, -2.0]])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a >= 2", [-1, 0, 1, 2]),
        ("not (a > 2)", [1, 0, -1, -2]),
        ("(a >= 2) and (b >= 2)", [-1, 0, 0, -1]),
        ("(a >= 2) or (b >= 2)", [2, 1, 1, 2]),
        ("(a >= 2) implies (c >= 0)", [1, 0, 5, -2]),
        ("always (a >= 2)", [-1, 0, 1, 2]),
        ("eventually (c >= 0)", [5, 5, 5, -2]),
        ("always[0:1] (c >= 0)", [-1, -1, -2, -2]),
        ("always[1:2] (c >= 0)", [-1, -2, -2, math.inf]),  # beyond the end there is nothing to violate it
        ("eventually[1:2] (c >= 0)", [5, 5, -2, -math.inf]),
        ("once[1:1] (a >= 0)", [-math.inf, 1, 2, 3]),
        ("historically (b >= 0)", [4, 3, 2, 1]),
        ("(b >= 1) until (c >= 5)", [0, 0, 0, -7]),  # c reaches 5 in sample 2, just
        ("rise(c >= 0)", [0, -1, 1, -5]),
        ("abs(c - 1) / 2 <= 1 + 0.5", [1, 0.5, -0.5, 0]),
    ],
)
def test_robustness_worked_by_hand(text, expected):
    np.testing.assert_allclose(ours(text, RAMP), expected)


# --- any formula, against rtamt --------------------------------------------------------------------------------------
numbers = st.sampled_from(["a", "b", "c", "(a - b)", "abs(c)", "(b * 2)", "a + 1.5", "(c / 4)"])
bounds = st.one_of(
    st.just(""), st.tuples(st.integers(0, 4), st.integers(0, 6)).map(lambda p: f"[{p[0]}:{p[0] + p[1]}]")
)
predicates = st.tuples(numbers, st.sampled_from([">=", "<=", ">", "<"]), st.sampled_from(["0", "1", "-0.5", "2.25"])).map(
    lambda p: f"({p[0]} {p[1]} {p[2]})"
)


def larger(inner):
    return st.one_of(
        inner.map(lambda f: f"(not {f})"),
        st.tuples(inner, st.sampled_from(["and", "or", "implies", "iff", "xor"]), inner).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
        st.tuples(st.sampled_from(["always", "eventually", "once", "historically"]), bounds, inner).map(
            lambda p: f"({p[0]}{p[1]} {p[2]})"
        ),
        st.tuples(inner, st.sampled_from(["until", "since"]), bounds, inner).map(lambda p: f"({p[0]} {p[1]}{p[2]} {p[3]})"),
        inner.map(lambda f: f"rise({f})"),
        inner.map(lambda f: f"fall({f})"),
    )


@settings(max_examples=120, deadline=None)
@given(st.recursive(predicates, larger, max_leaves=5), st.integers(0, 1000), st.integers(2, 25))
def test_any_formula_agrees_with_rtamt(text, seed, n):
    values = np.random.default_rng(seed).integers(-8, 9, (3, n)) / 4.0
    theirs = robustness(text, dict(zip(VARIABLES, values, strict=True)), 1.0)
    np.testing.assert_array_equal(ours(text, values), theirs)


def test_bounds_are_seconds():
    np.testing.assert_allclose(ours("eventually[0:1] (c >= 0)", RAMP, dt=0.5), [5, 5, 5, -2])
    assert robustness("eventually[0:1] (c >= 0)", dict(zip(VARIABLES, RAMP, strict=True)), 0.5) == [5, 5, 5, -2]
    with pytest.raises(ConfigError, match=r"whole multiples of the control interval, 0\.5 s"):
        ours("eventually[0:0.7] (c >= 0)", RAMP, dt=0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("alwys (a > 3)", r"character 1 .*unknown signal 'alwys'"),
        ("always (clearence > 3)", r"unknown signal 'clearence'; did you mean 'clearance'\?"),
        ("always (range > 3", r"expected '\)', got 'the end'"),
        ("range", r"expected a comparison, this is only a number"),
        ("always (range)", r"expected a comparison after 'always'"),
        ("range > 3 and speed > 2 or t > 1", r"put parentheses around what stands left of 'or'"),
        ("always (range > 3) and (speed > 2)", r"put parentheses around what stands left of 'and'"),
        ("not range > 3", r"expected '\(' after 'not'"),
        ("speed - range + t > 1", r"put parentheses: '-' and '\+' side by side"),
        ("eventually[5:2] (range > 1)", r"expected a bound of at least 5 s, got 2"),
        ("range >> 3", r"expected a signal, a number or '\(', got '>'"),
        ("range > 3 ; speed > 2", r"unexpected ';'"),
    ],
)
def test_what_is_wrong_with_a_formula_is_said(text, message):
    with pytest.raises(ConfigError, match=message):
        requirement(text)


# --- the catalogue ---------------------------------------------------------------------------------------------------
def test_the_catalogue_covers_the_rules_and_is_judged_by_the_kernels():
    catalogue = read_requirements("colregs")
    assert {one.rule for one in catalogue.values()} == {2, 6, 8, 13, 14, 15, 16, 17}
    assert {one.engine for one in catalogue.values()} == {"kernel"}
    assert all(one.text for one in catalogue.values())
    assert len(NAMES) == len(set(NAMES))
