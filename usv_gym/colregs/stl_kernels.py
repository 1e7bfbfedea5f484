"""Robustness of compiled formulas over a trace: a stack machine whose values are whole traces."""

from __future__ import annotations

import math

from ..jit import inner, spliced
from .stl import Op

_SIGNAL, _CONST, _ABS = int(Op.SIGNAL), int(Op.CONST), int(Op.ABS)
_ADD, _SUB, _MUL, _DIV = int(Op.ADD), int(Op.SUB), int(Op.MUL), int(Op.DIV)
_GE, _LE, _EQ, _NE, _NOT, _AND, _OR = (int(op) for op in (Op.GE, Op.LE, Op.EQ, Op.NE, Op.NOT, Op.AND, Op.OR))
_IMPLIES, _IFF, _XOR = int(Op.IMPLIES), int(Op.IFF), int(Op.XOR)
_ALWAYS, _EVENTUALLY, _HISTORICALLY, _ONCE = int(Op.ALWAYS), int(Op.EVENTUALLY), int(Op.HISTORICALLY), int(Op.ONCE)
_UNTIL, _SINCE, _RISE, _FALL = int(Op.UNTIL), int(Op.SINCE), int(Op.RISE), int(Op.FALL)


@inner
def _binary(op, a, b, n):
    """a <- a op b, sample by sample."""
    if op == _ADD:
        for i in range(n):
            a[i] += b[i]
    elif op in (_SUB, _GE):
        for i in range(n):
            a[i] -= b[i]
    elif op == _LE:
        for i in range(n):
            a[i] = b[i] - a[i]
    elif op == _MUL:
        for i in range(n):
            a[i] *= b[i]
    elif op == _DIV:
        for i in range(n):
            a[i] /= b[i]
    elif op in (_EQ, _IFF):
        for i in range(n):
            a[i] = -abs(a[i] - b[i])
    elif op in (_NE, _XOR):
        for i in range(n):
            a[i] = abs(a[i] - b[i])
    elif op == _AND:
        for i in range(n):
            a[i] = min(a[i], b[i])
    elif op == _OR:
        for i in range(n):
            a[i] = max(a[i], b[i])
    else:
        for i in range(n):
            a[i] = max(-a[i], b[i])


@inner
def _unary(op, a, n):
    """a <- op a, where it needs no window."""
    if op == _ABS:
        for i in range(n):
            a[i] = abs(a[i])
    elif op == _NOT:
        for i in range(n):
            a[i] = -a[i]
    elif op in (_RISE, _FALL):
        sign = 1.0 if op == _RISE else -1.0
        before = -math.inf
        for i in range(n):
            now = sign * a[i]
            a[i] = min(-before, now)
            before = now


@inner
def reverse(a, n):
    """Turn a trace round in time."""
    for i in range(n // 2):
        a[i], a[n - 1 - i] = a[n - 1 - i], a[i]


@inner
def _window(a, n, low, high, sign, queue):
    """a[i] <- sign * min of sign * a over the samples i - high .. i - low that exist; inf without any; high < 0: all up to i.

    A queue of candidates in rising order (Lemire 2006), so that the cost does not depend on the window.
    """
    if high < 0:
        best = math.inf
        for i in range(n):
            best = min(best, sign * a[i])
            a[i] = sign * best
        return
    # places of the candidates in queue[0], their values in queue[1], what a was in queue[2]
    head, tail = 0, 0
    for i in range(n):
        queue[2, i] = a[i]
        k = i - low
        if k >= 0:
            value = sign * queue[2, k]
            while tail > head and queue[1, tail - 1] >= value:
                tail -= 1
            queue[0, tail], queue[1, tail] = k, value
            tail += 1
        while tail > head and queue[0, head] < i - high:
            head += 1
        a[i] = sign * (queue[1, head] if tail > head else math.inf)


@inner
def _since(a, b, n, low, high):
    """a <- a since b: b held low..high samples ago, and a ever after; high < 0: any time ago."""
    if high < 0:
        before = -math.inf
        for i in range(n):
            before = max(b[i], min(a[i], before))
            a[i] = before
        return
    for i in range(n - 1, -1, -1):
        best, held = -math.inf, math.inf
        for back in range(min(high, i) + 1):
            if back >= low:
                best = max(best, min(held, b[i - back]))
            held = min(held, a[i - back])
        a[i] = best


@spliced
def robustness(ops, arguments, signals, n, stack, queue):
    """Run a program on the first n samples of signals [S, T]; the robustness at every sample is left in stack[0].

    ops, arguments: of a Program, bounds in samples; stack [depth, T] and queue [3, T] are work space.
    """
    top = -1
    for k in range(ops.shape[0]):
        op = ops[k]
        low, high = int(arguments[k, 0]), int(arguments[k, 1])
        if op == _SIGNAL:
            top += 1
            for i in range(n):
                stack[top, i] = signals[low, i]
        elif op == _CONST:
            top += 1
            for i in range(n):
                stack[top, i] = arguments[k, 0]
        elif op in (_UNTIL, _SINCE):
            top -= 1
            if op == _UNTIL:
                reverse(stack[top], n)
                reverse(stack[top + 1], n)
            _since(stack[top], stack[top + 1], n, low, high)
            if op == _UNTIL:
                reverse(stack[top], n)
        elif op >= _ALWAYS and op <= _ONCE:
            sign = 1.0 if op in (_ALWAYS, _HISTORICALLY) else -1.0
            ahead = op in (_ALWAYS, _EVENTUALLY)
            if ahead:
                reverse(stack[top], n)
            _window(stack[top], n, low, high, sign, queue)
            if ahead:
                reverse(stack[top], n)
        elif op in (_ABS, _NOT, _RISE, _FALL):
            _unary(op, stack[top], n)
        else:
            top -= 1
            _binary(op, stack[top], stack[top + 1], n)


@inner
def worst_sample(ops, arguments, signals, n, stack, queue):
    """(robustness at the start, the sample that decided it) of a program that may begin with an unbounded ``always``.

    Of any other formula the sample is 0: the whole episode decides.
    """
    n_ops = ops.shape[0]
    always = ops[n_ops - 1] == _ALWAYS and arguments[n_ops - 1, 1] < 0
    robustness(ops[: n_ops - 1] if always else ops, arguments, signals, n, stack, queue)
    at = 0
    for i in range(n if always else 1):
        if stack[0, i] < stack[0, at]:
            at = i
    return stack[0, at], at
