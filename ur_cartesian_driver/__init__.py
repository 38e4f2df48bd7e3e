# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Driver for Universal Robots arms that carries out Cartesian trajectories."""

from pkgutil import extend_path

# The build generates and installs the modules msg, srv and action, while the others may be used
# from the source tree (an editable install, `python -m` in a checkout). The next line joins both
# directories into one package.
__path__ = extend_path(__path__, __name__)
