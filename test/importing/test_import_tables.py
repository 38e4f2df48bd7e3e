# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of the importers has the tables that they use."""

from pathlib import Path

import pytest

from ur_cartesian_driver.importing import FORMATS, Treatment

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(not (CHECKOUT / 'doc').is_dir(), reason='only a checkout has this page')
def test_the_page_has_the_tables_of_the_importers(monkeypatch):
    monkeypatch.syspath_prepend(CHECKOUT / 'scripts')
    from make_import_tables import PAGE, page_with_tables

    page = PAGE.read_text(encoding='utf-8')
    assert page == page_with_tables(page), 'run scripts/make_import_tables.py'


@pytest.mark.parametrize('form', FORMATS.values(), ids=FORMATS)
def test_what_is_not_honoured_has_a_reason(form):
    assert form.others.endswith('.')
    for term in form.terms.values():
        assert term.reason or term.treatment is Treatment.HONOURED, term.name
