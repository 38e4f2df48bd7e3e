# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plan that knows its arm, so that it can be displayed."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import mkstemp
import webbrowser

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.workspace import Plane
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.preview.motion_page import motion_page


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmPlan(Plan):
    """A plan with the arm for which it was made."""

    arm: Arm
    #: The workspace planes, which the plan does not cross.
    planes: tuple[Plane, ...] = ()

    @classmethod
    def of(cls, plan: Plan, arm: Arm, planes: tuple[Plane, ...] = ()) -> ArmPlan:
        """Return a plan together with its arm."""
        return cls(
            **{field.name: getattr(plan, field.name) for field in fields(Plan)},
            arm=arm,
            planes=planes,
        )

    def write_page(self, path: str | Path) -> None:
        """
        Write the page that shows the arm and its path over time; the page opens without a network.

        :raises ImportError: viser is not installed; the text says how to get it.
        """
        Path(path).write_text(motion_page(self, self.arm, self.planes), encoding='utf-8')

    def show(self) -> Path:
        """Write the page to a temporary file, open it in the browser, and return its file path."""
        descriptor, name = mkstemp(prefix='motion_', suffix='.html')
        path = Path(name)
        with open(descriptor, 'w', encoding='utf-8') as file:
            file.write(motion_page(self, self.arm, self.planes))
        webbrowser.open(path.as_uri())
        return path
