"""Runs a notebook from top to bottom, and keeps its pictures: notebook.py FILE [FOLDER]."""

from __future__ import annotations

import base64
import sys
from pathlib import Path

import nbclient
import nbformat


def main(file: str, folder: str = "target/notebooks") -> None:
    notebook = nbformat.read(file, as_version=4)
    where = {"metadata": {"path": str(Path(file).resolve().parent)}}
    nbclient.NotebookClient(notebook, timeout=240, kernel_name="python3", resources=where).execute()
    pictures = Path(folder)
    pictures.mkdir(parents=True, exist_ok=True)
    found = 0
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            png = output.get("data", {}).get("image/png")
            if png is not None:
                name = f"{Path(file).stem}-{found}.png"
                (pictures / name).write_bytes(base64.b64decode(png))
                found += 1
    if not found:
        sys.exit(f"{file} has no pictures")
    print(f"{file}: {len(notebook.cells)} cells, {found} pictures in {folder}")


main(*sys.argv[1:])
