"""What an equation of the documentation gives for numbers: just enough LaTeX to hold its right side against the code."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

Number = float | complex
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|[A-Za-z]|\d+(?:\.\d+)?|\S")
_SPACES = {r"\,", r"\ ", r"\left", r"\right"}


def value(latex: str, numbers: Mapping[str, Number]) -> Number:
    """Return the value of an expression; symbols are looked up as written, ``k_{MR}`` or ``\\dot x``.

    Examples
    --------
    >>> value(r"\\frac{a}{2} b_1^2 + |c| e^{-d}", {"a": 4, "b_1": 3, "c": -1, "d": 0})
    19.0
    """
    return _Reading(latex, numbers).whole()


class _Reading:
    def __init__(self, latex: str, numbers: Mapping[str, Number]) -> None:
        self.tokens = [token for token in _TOKEN.findall(latex) if token not in _SPACES]
        self.numbers = numbers
        self.place = 0
        self.bars = False

    def peek(self) -> str:
        return self.tokens[self.place] if self.place < len(self.tokens) else ""

    def take(self, expected: str = "") -> str:
        token = self.peek()
        assert token, "the expression ends too early"
        assert token == (expected or token), f"expected '{expected}', found '{token}'"
        self.place += 1
        return token

    def whole(self) -> Number:
        total = self.sum()
        assert not self.peek(), f"'{self.peek()}' is left"
        return total

    def sum(self) -> Number:
        total: Number = 0.0
        sign = 1
        while True:
            while self.peek() in ("+", "-"):
                sign = -sign if self.take() == "-" else sign
            total += sign * self.product()
            sign = 1
            if self.peek() not in ("+", "-"):
                return total

    def product(self) -> Number:
        total = self.power()
        inside_bars = self.bars
        while self.peek() not in ("", "+", "-", ")", "]", "}", ",", ";") and not (self.peek() == "|" and inside_bars):
            if self.peek() == "/":
                self.take()
                total = total / self.power()
            else:
                total = total * self.power()
        return total

    def power(self) -> Number:
        base = self.atom()
        if self.peek() == "^":
            self.take()
            return base ** self.argument()
        return base

    def argument(self) -> Number:
        if self.peek() == "{":
            self.take("{")
            return self.bracketed("}")
        return self.atom()

    def bracketed(self, end: str) -> Number:
        bars, self.bars = self.bars, False
        inner = self.sum()
        self.bars = bars
        self.take(end)
        return inner

    def atom(self) -> Number:
        token = self.take()
        if token in "([":
            return self.bracketed(")" if token == "(" else "]")
        if token == "|":
            bars, self.bars = self.bars, True
            inner = abs(self.sum())
            self.bars = bars
            self.take("|")
            return inner
        if token in (r"\frac", r"\tfrac"):
            above = self.argument()
            return above / self.argument()
        if token == r"\sqrt":
            return self.argument() ** 0.5
        if token[0].isdigit():
            return float(token)
        if token == r"\log":
            self.take("_")
            self.take("{")
            self.take("10")
            self.take("}")
            return math.log10(self.atom())
        if token == r"\sin":
            return math.sin(self.atom())
        return self.symbol(token)

    def symbol(self, token: str) -> Number:
        """Read a letter with its accent, index and primes; ``EI`` and other words where they are known."""
        name = f"{token} {self.take()}" if token in (r"\dot", r"\ddot", r"\Delta", r"\mathrm") else token
        for word in sorted((w for w in self.numbers if w[0] == token and len(w) > 1 and w.isalpha()), reverse=True):
            if "".join(self.tokens[self.place - 1 : self.place - 1 + len(word)]) == word:
                self.place += len(word) - 1
                name = word
                break
        if self.peek() == "_":
            self.take()
            index = self.take()
            if index == "{":
                index = "{"
                while self.peek() != "}":
                    index += self.take()
                index += self.take()
            name = f"{name}_{index}"
        if name == "e" and name not in self.numbers:
            return math.e
        return self.numbers[name]
