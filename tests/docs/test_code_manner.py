"""What the code promises of itself: short functions, a kernel of few libraries, arrays told by shape or unit."""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KERNEL = ROOT / "server" / "tracemesh" / "geometry"
LONGEST = 40
LIBRARIES = {"numpy", "scipy", "qdldl", "robust_laplacian", "pythoncdt", "vqf", "pygeomag"}
TOLD = re.compile(r"\((\w+|\.\.\.)(, ?[\w+ .]+)*,?\)|\b(m|mm|rad|degrees|1/m|unit|relative)\b")
Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(folder: Path) -> Iterator[tuple[str, Function]]:
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, Function):
                yield f"{path.relative_to(folder)}:{node.lineno} {node.name}", node


def public(folder: Path) -> Iterator[tuple[str, Function]]:
    """Functions of modules and methods of classes that others may use."""
    for path in sorted(folder.rglob("*.py")):
        top = ast.parse(path.read_text()).body
        classes = [n for n in top if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
        for node in (*top, *(inner for c in classes for inner in c.body)):
            if isinstance(node, Function) and not node.name.startswith("_"):
                yield f"{path.relative_to(folder)}:{node.lineno} {node.name}", node


def test_no_function_is_longer_than_forty_lines() -> None:
    found = [f for folder in ("server", "device_bridge") for f in functions(ROOT / folder)]
    assert len(found) > 1000
    assert [name for name, node in found if (node.end_lineno or 0) - node.lineno >= LONGEST] == []


def test_the_kernel_imports_only_numerical_libraries() -> None:
    foreign = set()
    for path in KERNEL.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            ours = ("tracemesh.geometry", "tracemesh.errors")
            foreign |= {n for n in names if n.split(".")[0] not in LIBRARIES | sys.stdlib_module_names | {"tracemesh"}}
            foreign |= {n for n in names if n.startswith("tracemesh") and not n.startswith(ours)}
    assert foreign == set()


def test_public_functions_of_the_kernel_tell_shapes_or_units_of_their_arrays() -> None:
    silent = []
    for name, node in public(KERNEL):
        arrays = [a for a in (*node.args.args, *node.args.kwonlyargs) if a.annotation and is_array(a.annotation)]
        returned = node.returns is not None and is_array(node.returns)
        if arrays or returned:
            told = TOLD.search(ast.get_docstring(node) or "")
            silent += [] if told else [name]
    assert silent == []


def is_array(annotation: ast.expr) -> bool:
    return bool(re.search(r"\b(Floats|Ints|Bools|NDArray)\b", ast.unparse(annotation)))
