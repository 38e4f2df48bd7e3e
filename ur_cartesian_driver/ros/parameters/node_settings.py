# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The parameters that only the node uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from ur_cartesian_driver.motion.goal.field_annotations import Range
from ur_cartesian_driver.motion.goal.parameter_fields import check_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSettings:
    """The parameters that the node itself uses."""

    #: What happens to a goal that arrives while another one runs. preempt: it is checked from
    #: where the arm would come to rest. If it is refused, the running goal continues undisturbed.
    #: If it passes, the arm is stopped, the running goal ends PREEMPTED, and the new one runs.
    #: reject: the new one ends ABORTED.
    on_new_goal: Literal['preempt', 'reject'] = 'preempt'
    #: Largest delay of the end of a goal, unless the goal specifies one [s].
    goal_time_tolerance: Annotated[float, Range(0.001, 3600.0)] = 1.0
    #: Rate of joint_states, ~/tcp_pose, ~/wrench, ~/speed_scaling and /tf [Hz].
    state_publish_rate: Annotated[float, Range(1.0, 500.0)] = 50.0
    #: Rate of /diagnostics [Hz]; 0.0: never.
    diagnostics_rate: Annotated[float, Range(0.0, 50.0)] = 1.0
    #: Publish the frames of the robot description in /tf, if tf2_msgs is installed; false: leave
    #: that to robot_state_publisher.
    publish_link_frames: bool = False
    #: Each 'name parent x y z qx qy qz qw' [m, unit quaternion]: fixed frames for goals, and tools
    #: as controlled frames. The parent is base, base_link, tool0, flange, tool0_controller (each
    #: with tf_prefix), or another of these frames. Empty texts are skipped.
    #:
    #: Example: ['table base_link 0.4 0 0.1 0 0 0 1', 'nozzle tool0 0 0 0.15 0 0 0.7071 0.7071']
    static_frames: tuple[str, ...] = ()
    #: Largest age of the newest tf2 transform of a frame when a goal is planned [s]. All frames
    #: that the driver does not know itself are looked up in tf2, if it is installed. Static
    #: transforms have no age.
    tf_max_age: Annotated[float, Range(0.001, 3600.0)] = 1.0
    #: Topic on which MoveIt publishes its planning scene, for example /monitored_planning_scene:
    #: its objects become bodies of the cell, if moveit_msgs is installed. Empty: none.
    planning_scene_topic: str = ''
    #: true: the arm follows a pose on ~/live_target as soon as it arrives and no goal runs.
    live_target_enabled: bool = False
    #: Largest rate of ~/servo_state [Hz]; 0.0: never.
    servo_state_rate: Annotated[float, Range(0.0, 500.0)] = 25.0

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check_parameters(self)
