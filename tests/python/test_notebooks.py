"""The notebooks of examples/notebooks: each cell runs, and none has an output committed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples" / "notebooks").glob("*.ipynb"))


def cells_of(notebook):
    document = json.loads(notebook.read_text(encoding="utf-8"))
    return [cell for cell in document["cells"] if cell["cell_type"] == "code"]


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 7


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_has_no_outputs(notebook, tmp_path):
    cells = cells_of(notebook)
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    source = "\n\n".join("".join(cell["source"]) for cell in cells)
    if "scipy" in source:
        pytest.importorskip("scipy", reason="not checked: python3-scipy is missing")
    script = tmp_path / "notebook.py"
    script.write_text(source, encoding="utf-8")
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path,
                          capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"})
    assert done.returncode == 0, done.stderr
