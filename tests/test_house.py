"""The house itself: what a reader of the code may count on."""

import ast
from graphlib import TopologicalSorter
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


def test_no_modules_import_each_other_in_a_circle():
    names = {_name(path): path for path in SOURCE.rglob("*.py")}
    house = {name: _imported(path, names) - {name} for name, path in names.items()}
    assert set(TopologicalSorter(house).static_order()) == set(names)


def _name(path):
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(path, names):
    """The modules that a file names in its imports, those within functions and for types too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            # A name of a package is a module of it, or else what its own file holds.
            wholes = [f"{node.module}.{one.name}" for one in node.names]
            found |= {whole if whole in names else node.module for whole in wholes}
    return found & set(names)
