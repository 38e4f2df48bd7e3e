# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plan that knows its arm, so that it can be displayed."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import mkstemp
import webbrowser

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.preview.motion_page import motion_page, NO_BODIES


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmPlan(Plan):
    """A plan with the arm for which it was made."""

    arm: Arm
    #: The options of the plan, with the planes and the cell that it keeps away from.
    options: PlanningOptions = NO_BODIES

    @classmethod
    def of(cls, plan: Plan, arm: Arm, options: PlanningOptions = NO_BODIES) -> ArmPlan:
        """Return a plan together with its arm and its options."""
        return cls(
            **{field.name: getattr(plan, field.name) for field in fields(Plan)},
            arm=arm,
            options=options,
        )

    def write_page(self, path: str | Path) -> None:
        """
        Write the page that shows the arm and its path over time; the page opens without a network.

        :raises ImportError: viser is not installed; the text says how to get it.
        """
        Path(path).write_text(motion_page(self, self.arm, self.options), encoding='utf-8')

    def show(self) -> Path:
        """Write the page to a temporary file, open it in the browser, and return its file path."""
        descriptor, name = mkstemp(prefix='motion_', suffix='.html')
        path = Path(name)
        with open(descriptor, 'w', encoding='utf-8') as file:
            file.write(motion_page(self, self.arm, self.options))
        webbrowser.open(path.as_uri())
        return path
