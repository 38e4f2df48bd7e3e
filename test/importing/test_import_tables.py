# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of the importers has the tables that they use."""

import re

from checkout import CHECKOUT, needs_checkout
import pytest

from ur_cartesian_driver.importing import FORMATS, Treatment

OURS = [name for name in FORMATS.built_in if not name.startswith('.')]


@needs_checkout
def test_the_page_has_the_tables_of_the_importers(monkeypatch):
    monkeypatch.syspath_prepend(CHECKOUT / 'scripts')
    from make_import_tables import PAGE, page_with_tables

    page = PAGE.read_text(encoding='utf-8')
    assert re.findall('<!-- terms of (.*) -->', page) == OURS
    assert page == page_with_tables(page), 'run scripts/make_import_tables.py'


@pytest.mark.parametrize('name', OURS)
def test_what_is_not_honoured_has_a_reason(name):
    form = FORMATS[name]
    assert form.others.endswith('.')
    for term in form.terms.values():
        assert term.reason or term.treatment is Treatment.HONOURED, term.name
