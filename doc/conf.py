# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The documentation site: ``make docs`` builds these pages into ``build/site``."""

from pathlib import Path
import sys
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

_package = ElementTree.parse(HERE.parent / 'package.xml').getroot()

project = _package.findtext('name', '')
author = 'the contributors'
copyright = '2026, the ur_cartesian_driver contributors'
version = release = _package.findtext('version', '')

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'site_pages']
root_doc = 'index'

# The slugs of headings are those of GitHub, where the same pages are read.
myst_heading_anchors = 4
myst_enable_extensions = ['colon_fence']

autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented'
autodoc_class_signature = 'separated'
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True

html_theme = 'furo'
html_title = 'UR Cartesian Driver'
html_copy_source = False
html_show_sphinx = False
# Nothing is fetched from elsewhere: the site is read and searched without a network.
html_theme_options = {'top_of_page_buttons': []}
html_search_scorer = str(HERE / 'search_scorer.js')
