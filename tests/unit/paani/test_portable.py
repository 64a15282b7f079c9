"""Elementary functions that give the same bits whatever the processor's own are."""

from __future__ import annotations

import hashlib
import math
import os
import re
import subprocess
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paani import portable
from tests.places import ROOT

DIGEST = """
import hashlib, random
from paani import portable as p

dice = random.Random(1)
text = "".join(
    f(dice.uniform(0.001, 3.0)).hex()
    for _ in range(4000)
    for f in (lambda x: p.exp(-x), p.log, p.sin, p.cos, p.tan, lambda x: p.atan2(x, 1.3), lambda x: p.atan2(-x, -1.3))
)
print(hashlib.sha256(text.encode()).hexdigest())
"""
PLAIN = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX"}  # the C library without fused multiply-add


def close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=2e-15, abs_tol=5e-16)


@given(st.floats(-745.0, 700.0))
@example(0.0)
def test_exp(x: float) -> None:
    assert math.isclose(portable.exp(x), math.exp(x), rel_tol=1e-15, abs_tol=1e-320)


@given(st.floats(1e-300, 1e300))
@example(1.0)
def test_log(x: float) -> None:
    assert close(portable.log(x), math.log(x))


@given(st.floats(-1e6, 1e6))
@example(0.0)
@example(math.pi)
@example(-math.pi / 2)
def test_sine_and_cosine(rad: float) -> None:
    exact = math.remainder(rad, math.tau)
    assert close(portable.sin(rad), math.sin(exact))
    assert close(portable.cos(rad), math.cos(exact))


@given(st.floats(-1.5, 1.5))
def test_tan(rad: float) -> None:
    assert close(portable.tan(rad), math.tan(rad))


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
@example(0.0, -1.0)
@example(-0.0, -1.0)
@example(0.0, 0.0)
@example(-0.0, -0.0)
@example(1.0, 0.0)
@example(5e-324, -5e-324)
def test_atan2(y: float, x: float) -> None:
    angle = portable.atan2(y, x)
    assert close(angle, math.atan2(y, x))
    assert math.copysign(1.0, angle) == math.copysign(1.0, y)
    assert -math.pi <= angle <= math.pi


def test_what_is_no_number_is_treated_as_the_library_does() -> None:
    assert portable.exp(-1e9) == portable.exp(-math.inf) == 0.0
    for function, number in ((portable.log, 0.0), (portable.log, -1.0), (portable.sin, math.inf)):
        with pytest.raises(ValueError, match=r"math domain error|expected a positive input"):
            function(number)
    with pytest.raises(OverflowError):
        portable.exp(1e4)
    assert math.isnan(portable.atan2(math.nan, 1.0))
    assert portable.log(math.inf) == math.inf


@pytest.mark.slow
def test_another_processor_gives_the_same_bits() -> None:
    digests = [
        subprocess.run(
            [sys.executable, "-c", DIGEST],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, **environment},
        ).stdout
        for environment in ({}, PLAIN)
    ]
    assert digests[0] == digests[1]
    assert len(digests[0].strip()) == len(hashlib.sha256().hexdigest())


@pytest.mark.parametrize("service", ["advisor", "navigator", "controller"])
def test_deciding_code_uses_no_function_that_differs_between_machines(service: str) -> None:
    forbidden = re.compile(
        r"\bmath\.(exp|exp2|expm1|log|log2|log10|log1p|sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|pow|cbrt)\b"
        r"|\*\*\s*[\w(]|\bnp\.(exp|log|sin|cos|tan|arctan2|power|dot|sum|mean|matmul|einsum)\b|\bpow\("
    )
    for path in (ROOT / "services/paani_services" / service).glob("*.py"):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if not re.search(r"\(\*\*|, \*\*|\{\*\*", line):  # keyword arguments
                assert not forbidden.search(line), f"{path.name}:{number}: {line.strip()} (see paani.portable)"
