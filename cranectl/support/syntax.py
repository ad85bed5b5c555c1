"""Reduce Python source to what the interpreter runs, so that comments and docstrings count in no digest."""

import ast

_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def syntax_of(content: bytes) -> bytes:
    """Return the syntax tree of Python source as text, without comments and docstrings.

    The text does not depend on the version of Python. Docstrings stay where the source names ``__doc__``.

    Parameters
    ----------
    content
        Source of a module.

    Returns
    -------
    bytes
        The tree, or `content` itself if it is no Python.

    """
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):
        return content
    if b"__doc__" not in content:
        for node in ast.walk(tree):
            if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
                del node.body[0]
    return _text(tree).encode()


def _text(node: object) -> str:
    """Return a node with its fields, the same from all versions of Python: they differ in what is empty."""
    if isinstance(node, ast.JoinedStr):
        return f"JoinedStr({_text(_merged(node.values))})"
    if isinstance(node, ast.AST):
        fields = [(name, getattr(node, name, None)) for name in node._fields if name != "kind"]
        inner = (f"{name}={_text(value)}" for name, value in fields if value not in (None, []))
        return f"{type(node).__name__}({','.join(inner)})"
    if isinstance(node, list):
        return f"[{','.join(map(_text, node))}]"
    return repr(node)


def _merged(parts: list[ast.expr]) -> list[ast.expr | str]:
    """Return the parts of a formatted string, with adjacent texts joined and without empty ones."""
    merged: list[ast.expr | str] = []
    for part in parts:
        if not isinstance(part, ast.Constant):
            merged.append(part)
        elif merged and isinstance(merged[-1], str):
            merged[-1] += str(part.value)
        elif part.value:
            merged.append(str(part.value))
    return merged
