"""Signal temporal logic: from a formula's text to a program in postfix order that the kernels run.

The text is what rtamt reads, in the part of its language where nothing depends on its unusual precedences: whoever mixes
operators writes parentheses, here as a rule.  Robustness is that of Donze and Maler (2010); time is counted in samples, and
windows that reach beyond the end of an episode are cut there, as rtamt does.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError, suggestion


class Op(enum.IntEnum):
    """Codes of the instructions."""

    SIGNAL, CONST = 0, 1
    ADD, SUB, MUL, DIV, ABS = 2, 3, 4, 5, 6
    GE, LE, EQ, NE = 7, 8, 9, 10
    NOT, AND, OR, IMPLIES, IFF, XOR = 11, 12, 13, 14, 15, 16
    ALWAYS, EVENTUALLY, HISTORICALLY, ONCE = 17, 18, 19, 20
    UNTIL, SINCE, RISE, FALL = 21, 22, 23, 24


_COMPARISONS = {">=": Op.GE, ">": Op.GE, "<=": Op.LE, "<": Op.LE, "==": Op.EQ, "!==": Op.NE}
_BINARY = {"and": Op.AND, "or": Op.OR, "implies": Op.IMPLIES, "iff": Op.IFF, "xor": Op.XOR, "until": Op.UNTIL,
           "since": Op.SINCE}  # fmt: skip
_TEMPORAL = {"always": Op.ALWAYS, "eventually": Op.EVENTUALLY, "historically": Op.HISTORICALLY, "once": Op.ONCE}
_CALLS = {"rise": Op.RISE, "fall": Op.FALL}
_CHAINS = ("and", "or")  # that may be repeated without parentheses
_WORDS = {*_BINARY, *_TEMPORAL, *_CHAINS, *_CALLS, "not", "abs"}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*(?:[eE][-+]?\d+)?)|(?P<word>[A-Za-z_]\w*)|(?P<mark>>=|<=|==|!==|[-+*/()\[\]:,<>]))"
)
UNBOUNDED = -1.0


@dataclass(frozen=True)
class Program:
    """A formula as instructions in postfix order."""

    text: str
    ops: NDArray[np.int64]  # [n] of Op
    arguments: NDArray[np.float64]  # [n, 2]: signal number, constant, or bounds [s]; UNBOUNDED where there are none
    depth: int  # traces that are alive at the same time at most

    def in_samples(self, dt: float) -> NDArray[np.float64]:
        """Arguments with the bounds in samples of ``dt`` seconds.

        Raises
        ------
        ConfigError
            if a bound is no whole number of samples.
        """
        out = self.arguments.copy()
        timed = (self.ops >= Op.ALWAYS) & (self.ops <= Op.SINCE) & (out[:, 0] >= 0.0)
        samples = out[timed] / dt
        if (np.abs(samples - np.round(samples)) > 1e-6).any():
            raise ConfigError(f"{self.text!r}: bounds must be whole multiples of the control interval, {dt:g} s")
        out[timed] = np.round(samples)
        return out


@dataclass
class _Node:
    op: Op
    argument: tuple[float, float] = (UNBOUNDED, UNBOUNDED)
    children: tuple[_Node, ...] = ()
    closed: bool = True  # needs no parentheses to stand beside an operator
    truth: bool = True  # a statement, not a number
    spelt: str = ""  # the operator, of a chain that goes on without parentheses


def compile_formula(text: str, signals: Sequence[str]) -> Program:
    """Compile a formula over named signals.

    Raises
    ------
    ConfigError
        what is wrong and where: an unknown signal, a missing parenthesis, a number where a statement is expected.
    """
    root = _Parser(text, signals).formula()
    ops: list[int] = []
    arguments: list[tuple[float, float]] = []

    def write(node: _Node) -> int:
        need = 1
        for held, child in enumerate(node.children):
            need = max(need, held + write(child))
        ops.append(int(node.op))
        arguments.append(node.argument)
        return need

    depth = write(root)
    return Program(text, np.array(ops, np.int64), np.array(arguments, float).reshape(-1, 2), depth)


class _Parser:
    """Recursive descent: statements of operands, operands of sums, sums of products, products of factors."""

    def __init__(self, text: str, signals: Sequence[str]) -> None:
        self.text, self.numbers = text, {name: i for i, name in enumerate(signals)}
        self.tokens: list[tuple[str, str, int]] = []
        at = 0
        end = len(text.rstrip())
        while at < end:
            match = _TOKEN.match(text, at)
            if match is None:
                start = len(text[:at]) + len(text[at:]) - len(text[at:].lstrip())
                raise self._error(f"unexpected {text[start]!r}", start)
            kind = str(match.lastgroup)
            self.tokens.append((kind, match[kind], match.start(kind)))
            at = match.end()
        self.tokens.append(("end", "the end", end))
        self.k = 0

    def _error(self, message: str, at: int | None = None) -> ConfigError:
        place = self.tokens[self.k][2] if at is None else at
        return ConfigError(f"formula, character {place + 1} of {' '.join(self.text.split())!r}: {message}")

    @property
    def _next(self) -> str:
        return self.tokens[self.k][1]

    def _take(self, *expected: str) -> str:
        word = self._next
        if expected and word not in expected:
            raise self._error(f"expected {' or '.join(map(repr, expected))}, got {word!r}")
        self.k += 1
        return word

    def formula(self) -> _Node:
        node = self._statement()
        if self.tokens[self.k][0] != "end":
            raise self._error(f"expected an operator or the end, got {self._next!r}")
        if not node.truth:
            raise self._error("expected a comparison, this is only a number", 0)
        return node

    def _statement(self) -> _Node:
        left = self._operand()
        first = self._next
        while self._next in _BINARY:
            word = self._next
            if not left.closed or (left.spelt and (word != first or word not in _CHAINS)):
                raise self._error(f"put parentheses around what stands left of {word!r}")
            if not left.truth:
                raise self._error(f"expected a comparison left of {word!r}")
            self._take()
            bounds = self._bounds() if word in ("until", "since") else (UNBOUNDED, UNBOUNDED)
            right = self._operand()
            if not right.truth:
                raise self._error(f"expected a comparison right of {word!r}")
            left = _Node(_BINARY[word], bounds, (left, right), right.closed, spelt=word)
        return left

    def _operand(self) -> _Node:
        word = self._next
        if word in _TEMPORAL or word == "not":
            self._take()
            bounds = self._bounds() if word in _TEMPORAL else (UNBOUNDED, UNBOUNDED)
            if self._next not in ("(", "not", *_TEMPORAL, *_CALLS):
                raise self._error(f"expected '(' after {word!r}, got {self._next!r}")
            child = self._operand()
            if not child.truth:
                raise self._error(f"expected a comparison after {word!r}")
            return _Node(_TEMPORAL.get(word, Op.NOT), bounds, (child,), word == "not" and child.closed)
        if word in _CALLS:
            self._take()
            self._take("(")
            child = self._statement()
            self._take(")")
            return _Node(_CALLS[word], children=(child,))
        left = self._sum()
        if self._next not in _COMPARISONS:
            return left
        if left.truth:
            raise self._error("this compares a statement, not a number")
        word = self._take()
        right = self._sum()
        if right.truth:
            raise self._error("this compares with a statement, not a number")
        return _Node(_COMPARISONS[word], children=(left, right))

    def _bounds(self) -> tuple[float, float]:
        if self._next != "[":
            return UNBOUNDED, UNBOUNDED
        self._take("[")
        low = self._number()
        self._take(":", ",")
        at = self.tokens[self.k][2]
        high = self._number()
        self._take("]")
        if high < low:
            raise self._error(f"expected a bound of at least {low:g} s, got {high:g}", at)
        return low, high

    def _number(self) -> float:
        if self.tokens[self.k][0] != "number":
            raise self._error(f"expected a number of seconds, got {self._next!r}")
        value = float(self._take())
        if self._next == "s":
            self._take()
        return value

    def _sum(self) -> _Node:
        return self._chain({"+": Op.ADD, "-": Op.SUB}, self._product)

    def _product(self) -> _Node:
        return self._chain({"*": Op.MUL, "/": Op.DIV}, self._factor)

    def _chain(self, operators: dict[str, Op], part: Any) -> _Node:
        left: _Node = part()
        first = self._next
        while self._next in operators:
            if self._next != first:
                raise self._error(f"put parentheses: {first!r} and {self._next!r} side by side")
            word = self._take()
            right: _Node = part()
            if left.truth or right.truth:
                raise self._error(f"expected numbers on both sides of {word!r}")
            left = _Node(operators[word], children=(left, right), truth=False)
        return left

    def _factor(self) -> _Node:
        kind, word, _ = self.tokens[self.k]
        if word == "(":
            self._take()
            node = self._statement()
            self._take(")")
            return _Node(node.op, node.argument, node.children, truth=node.truth)
        if word == "abs":
            self._take()
            self._take("(")
            node = self._sum()
            self._take(")")
            if node.truth:
                raise self._error("expected a number in abs(...)")
            return _Node(Op.ABS, children=(node,), truth=False)
        if word == "-" and self.tokens[self.k + 1][0] == "number":
            self._take()
            return _Node(Op.CONST, (-float(self._take()), UNBOUNDED), truth=False)
        if kind == "number":
            return _Node(Op.CONST, (float(self._take()), UNBOUNDED), truth=False)
        if kind == "word" and word not in _WORDS:
            if word not in self.numbers:
                raise self._error(f"unknown signal {word!r}{suggestion(word, self.numbers)}")
            self._take()
            return _Node(Op.SIGNAL, (float(self.numbers[word]), UNBOUNDED), truth=False)
        raise self._error(f"expected a signal, a number or '(', got {word!r}")
