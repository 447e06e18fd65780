"""Pages of the documentation, run once for all tests of a process."""

import functools

import pytest
from tests.docs import DOCS, run_page


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """Return a function that runs a page, named from docs/, once; it returns what its blocks printed and the folder."""

    @functools.cache
    def run(name):
        folder = tmp_path_factory.mktemp("page")
        return run_page(DOCS / name, folder), folder

    return run
