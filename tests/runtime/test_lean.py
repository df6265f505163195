"""What is hidden from an import stays away, and can be imported afterwards."""

import importlib
import subprocess
import sys

import pytest

from runtime import lean


def test_what_is_hidden_cannot_be_imported_and_can_be_afterwards():
    sys.modules.pop("colorsys", None)
    with lean.without("colorsys"), pytest.raises(ModuleNotFoundError, match="not looked for"):
        importlib.import_module("colorsys")
    assert importlib.import_module("colorsys").rgb_to_yiq(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)


def test_lmfit_comes_without_frames_and_plots_and_fits():
    code = (
        "import sys; from runtime import lean; lean.import_lmfit(); "
        "from cellwright.numerics.least_squares import best_logarithms as best; "
        "found = best(lambda x: x - 1.5, [[0.0]], bounds=(-3, 3)); "
        "assert abs(found[0] - 1.5) < 1e-6, found; "
        "assert not {'pandas', 'matplotlib'} & set(sys.modules); "
        "import pandas; pandas.DataFrame({'a': [1]})"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_job_that_makes_no_table_for_people_imports_no_pandas():
    code = (
        "import sys; from runtime import artefact, lending, tables; "
        "assert not {'pandas', 'matplotlib', 'lmfit'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
