"""The house itself: what a reader of the code may count on."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "grebe"
LONGEST = 60
# Kernels work on arrays of one solve; to cut them up costs time in every step (docs/design.md).
KERNELS = SOURCE / "control" / "solvers" / "fast"
MODULES = sorted(path for path in SOURCE.rglob("*.py") if KERNELS not in path.parents)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_a_function_is_read_at_a_glance(path):
    too_long = [
        f"{node.name}: {length} lines"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (length := node.end_lineno - node.lineno + 1) > LONGEST
    ]
    assert not too_long


def test_the_modules_are_found():
    assert len(MODULES) > 200
