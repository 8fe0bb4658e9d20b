"""How Sphinx builds the site: guides as they stand, tutorials executed, the reference from the docstrings."""

import os
import shutil
import sys
import warnings
from importlib.metadata import version as installed_version
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "live/src"))  # the reference of the live service, which need not be installed
os.environ["TQDM_DISABLE"] = "1"  # progress bars are no output of a tutorial
for category in (RuntimeWarning, UserWarning):
    warnings.simplefilter("error", category)  # a tutorial that warns stops the build

project = "cylinder-friction"
release = version = installed_version("cylinder-friction")
project_copyright = "the authors of cylinder-friction, MIT licence"
extensions = [
    "myst_nb",
    "sphinx_external_toc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "sphinxarg.ext",
    "sphinx_copybutton",
]
html_theme = "furo"
html_title = project
html_show_sphinx = False
html_copy_source = False
myst_heading_anchors = 3
suppress_warnings = ["etoc.toctree"]  # the gallery's index brings a list of its own

autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}

sphinx_gallery_conf = {
    "examples_dirs": [str(ROOT / "examples")],
    "gallery_dirs": ["examples"],
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}


exclude_patterns = ["examples/*.ipynb"]  # the gallery's downloads
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # for one cell [s]
nb_merge_streams = True


def copy_notebooks(_app: Sphinx) -> None:
    """Copy the notebooks of ``examples/`` to where Sphinx looks for pages."""
    (ROOT / "docs/notebooks").mkdir(exist_ok=True)
    for notebook in (ROOT / "examples").glob("*.ipynb"):
        shutil.copy(notebook, ROOT / "docs/notebooks")


def setup(app: Sphinx) -> None:
    """Read the page of commands anew each time: Sphinx does not see the parser that it is made from."""
    app.connect("env-get-outdated", lambda *_: ["commands"])
    app.connect("builder-inited", copy_notebooks)
