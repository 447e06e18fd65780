"""The fakes, importable from any working directory, and one page for all tests that only read it."""

import importlib.util
import pathlib

import pytest

from contactsafe.report import write_report


@pytest.fixture(scope="session")
def fakes():
    path = pathlib.Path(__file__).with_name("fakes.py")
    spec = importlib.util.spec_from_file_location("report_fakes", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def experiments(fakes):
    return fakes.everything()


@pytest.fixture(scope="session")
def folder(fakes, experiments, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(folder, experiments, fakes.INFO)
    return folder


@pytest.fixture(scope="session")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")
