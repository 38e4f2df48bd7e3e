# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Names that are gone for good stay gone, and no name stands for two things.

doc/glossary.md says which word stands for what.
"""

from collections.abc import Callable, Iterator
import functools
import io
import keyword
from pathlib import Path
import re
import tokenize

from tracked_files import tracked_files

import ur_cartesian_driver

TESTS = Path(__file__).resolve().parent
CHECKOUT = TESTS.parent
PACKAGE = Path(ur_cartesian_driver.__file__).parent
GENERATED = ('action', 'msg', 'srv')

#: The names that a feature had, by the words that replaced them.
GONE = {
    # goals and plans
    'TcpKinematics': 'Reach',
    'SegmentDrafts': 'Draft Drafts',
    'SegmentGeometries, MovePath': 'Leg',
    'SegmentTimings': 'Timing',
    'JointPathPlanner': 'Route',
    'PathMargins, TightestMargin': 'Survey Surveyed survey Nearest nearest_of nearest_in',
    'Blend, BlendedPath, BlendPath': 'Corner JointCorner ToolCorner Meeting meetings round_ones',
    'blend_tolerance, slack': '_rooms',
    'JointSpeedBound, SpeedCheck': 'Pace _Pace pace paces knows_pace _wrong_pace',
    'JointPath, solve_joint_path': 'Followed followed',
    'PathSamples, PoseSamples': 'Samples Places places_on LEAST_PLACES',
    'SplinePath, JointPolynomials': 'SplineWay way_along JointTrack joint_track plan_pieces',
    'resolve_frames': 'placed',
    'RetargetedGoal, retarget_to_tcp': 'Carried',
    'adapt_to_dialect': 'spoken spoken_radius',
    'shift_reference_point, rigid_body': 'seen_at lever',
    'trigger_pose, trigger_direction': 'HAS_PLACE comes_round',
    'place_outputs, predict_stop': 'with_outputs come_to_rest',
    'DhTable, IdealArm, misfit_factor': 'Geometry shape_of Shape doubt DOUBTS',
    'path length, displacement': 'no_way _NO_WAY farthest_way',
    'execution mode': 'way_of_execution led_by',
    # append (keep_open)
    'append, appendable goal': 'OpenGoal open_goal open_goals OPEN_GOAL open_end OpenMotion',
    'AppendPlan, AppendedPoints': 'Part Addition addition ExtendMotion Continued',
    'AppendMachine, Appender': 'StreamMachine Continuing continuing continuation',
    'AppendSettings, AnswerAppend': 'StreamSettings AnswerExtension extension',
    'keep_open_horizon, keep_open_margin': 'stream_horizon stream_margin closing_deceleration',
    'committed_records, next_goal': 'firm time_behind',
    # servo, live targets, freedrive
    'SetLiveTarget, live_target': 'AimMotion servo_targets servo_to ServoTargets',
    'OnlineTrajectoryGenerator': 'TargetFollower follower',
    'LiveSession, LiveLimits, LiveSetup': 'FollowLimits follow_targets LiveOrder live_order',
    'LiveWorkspace, WorkspaceGuard': 'Surroundings surroundings',
    'SetpointSource': 'Setpoints _NoSetpoints',
    'freedrive': 'Guided teach teaches TeachMachine TeachService TeachStream allow_teach',
    'FreedriveState': 'HandGuided hand_guided is_guided NOBODY',
    'TargetInhibitor': 'Restraint restraint',
    # the life of a goal
    'ArmArbiter, ArmRequest: acquire, preempt': 'Turns Turn seize seize_for_now claim _turn_away',
    'preempted_by, on_preempt': 'successor predecessor make_way check_can_make_way',
    'ArmSnapshot': 'Stand',
    'MotionJob': 'Order order_of standing_order',
    'GoalMachine, GoalMonitor, GoalSignal': 'TrajectoryMachine Observer',
    'ToleranceCheck': 'Watch _goal_watch _path_watch _watches_tcp',
    'RUNNING_OUT, CANCELLING': 'CLOSING _enter_closing _enter_stopping',
    'AWAITING_POINTS': '_enter_waiting',
    'COMING_TO_REST, PROGRAM_LOST': 'HALTING ENDING _enter_halting _enter_ending',
    'temporary TCP, TcpPersistence': 'LendTcp lend_tcp TcpLent TcpLoan TcpHold LENT T_flange_lent',
    'TemporaryTcpSetter, RestoreTcp': 'GoalTcp ReturnTcp return_tcp tcp_owed owe_tcp',
    'resumable, ignored stops': 'borne HOLDS _WISHES',
    'stationary': 'standing_at standing_plan may_stand stand_at',
    # connection and driver
    'EventLog, LinkEventLog': 'Chronicle chronicle Evidence evidence Remark Said',
    'RecoveryRunner, RecoveryStep': 'WayBack way_back what_is_needed',
    'ServiceDispatcher, ServiceCall': 'CallDesk call_desk DashboardCalls',
    'LinkInterface': 'robot_view',
    'LinkTiming, LinkGaps': 'Pulse pulse Gaps',
    'DEAD_PROGRAM_TIMEOUT': 'GHOST _ghost_since _look_for_ghost',
    'OwnerHeartbeat, LoopHeartbeat': 'Alive SIGN_OF_LIFE last_sign',
    'PointBuffer': 'RecordsToSend records_to_send',
    'ProgramAutoStart': 'FirstStart first_start',
    'events of a recording': 'read_notes write_note NOTEWORTHY',
    '_warn_if_name_is_taken': '_look_for_a_twin _twin_timer',
    'DeferredActionServer, DeferredService': 'DeferringActionServer PromisedService',
    'TransformLookup, T_static': 'Transforms T_rigid',
    'explain_..., ..._refusal': 'why_not why_not_ready why_unreachable told_apart',
    'yield_cpu': 'breathe BREATH',
    'is_slow_to_make': 'is_slow',
    # the simulated controller
    'FaultInjector, FaultTrigger': 'Faults When Travelled Crossing',
    'ImpairedConnection, ImpairedSockets': 'Hampered hamper FaultySockets',
    'ControllerIo, ControllerMessages': 'Announcements announcements',
    'MotionOwnership': 'Ownership',
    'IkBranchTracker, changes_branch': 'changes_sides',
    'PathMotion, MotionProfile': 'Track Law check_law Tip tip',
    'DashboardHandlers': 'Desk desk',
    'PendantBuiltins': 'PeopleBuiltins',
    'ScriptInterpreter, ProgramRunner': 'Machine machine_of Programs',
    'UploadTooLong, UploadedProgram': 'TooLong ProgramText',
    'is_paused (an interface)': 'deaf was_deaf',
    # support of the tests
    'FaultGoal, planner verdict': 'GoalInTrouble agreement',
    'joint trace, synthetic recording': 'Ways fault_ways made_up_recording',
}

#: Bounds are MAX_ and MIN_, waiting times ..._TIMEOUT.
PREFIXES_GONE = ('MOST_', 'LEAST_', 'LARGEST_', 'SMALLEST_')
SUFFIXES_GONE = ('PATIENCE',)

#: Everyday words, as parts of names of the package: no term of the field.
WORDS_GONE = {'borne', 'nobody', 'room', 'rooms', 'spoken', 'told', 'way', 'ways'}

#: Names that two things in the package may have, with the reason.
SHARED_NAMES: dict[str, str] = {}


def own_modules(folder: Path) -> list[Path]:
    """Return the modules below a folder without what the build has made."""
    return [
        path
        for path in tracked_files(folder, '**/*.py')
        if not (folder == PACKAGE and path.relative_to(folder).parts[0] in GENERATED)
    ]


def all_modules() -> list[Path]:
    beside = [CHECKOUT / name for name in ('benchmark', 'scripts')]
    return [path for folder in (PACKAGE, TESTS, *beside) for path in own_modules(folder)]


def identifiers(source: str) -> set[str]:
    """Return all names of a module: classes, functions, parameters, attributes, modules."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    names = {token.string for token in tokens if token.type == tokenize.NAME}
    return {name for name in names if not keyword.iskeyword(name)}


@functools.cache
def names_gone() -> set[str]:
    return {name for names in GONE.values() for name in names.split()}


@functools.cache
def is_gone(name: str) -> bool:
    """Tell whether a name is one of those that are gone, or made like those."""
    bare = name.lstrip('_')
    return name in names_gone() or bare.startswith(PREFIXES_GONE) or bare.endswith(SUFFIXES_GONE)


@functools.cache
def everyday_words(name: str) -> set[str]:
    parts = re.findall(r'[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])', name)
    return {part.lower() for part in parts} & WORDS_GONE


def names_where(condition: Callable[[str], object], path: Path) -> list[str]:
    """Return the names of a module, its own included, for which a condition holds."""
    source = path.read_text()
    # Most modules do not even have such a word in a comment, and tokens take their time.
    if not any(map(condition, {path.stem, *re.findall(r'[^\W\d]\w*', source)})):
        return []
    return sorted(filter(condition, {path.stem, *identifiers(source)}))


def shared(named: Iterator[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that occur more than once, with their places."""
    places: dict[str, list[str]] = {}
    for name, place in named:
        places.setdefault(name, []).append(place)
    return {
        name: found
        for name, found in places.items()
        if len(found) > 1 and name not in SHARED_NAMES
    }


def classes() -> Iterator[tuple[str, str]]:
    for path in own_modules(PACKAGE):
        for name in re.findall(r'^ *class (\w+)[(:]', path.read_text(), re.MULTILINE):
            yield name, str(path.relative_to(PACKAGE))


def module_names(folder: Path) -> Iterator[tuple[str, str]]:
    for path in own_modules(folder):
        if path.stem not in ('__init__', '__main__', 'conftest'):
            yield path.stem, str(path.relative_to(folder))


def test_names_that_are_gone_are_recognised():
    source = 'def seize(MOST_JOBS, *, patience=JOIN_PATIENCE):\n    return x.LeastOne + _LEAST_X\n'
    assert {name for name in identifiers(source) if is_gone(name)} == {
        'seize',
        'MOST_JOBS',
        'JOIN_PATIENCE',
        '_LEAST_X',
    }
    assert everyday_words('_PathWay_2') == everyday_words('UNDER_WAY') == {'way'}
    assert everyday_words('waypoint') == everyday_words('Always') == set()


def test_a_name_that_is_gone_stays_gone():
    found = {str(path): names_where(is_gone, path) for path in all_modules()}
    assert {path: names for path, names in found.items() if names} == {}, 'GONE has the new words'


def test_no_name_of_the_package_has_an_everyday_word_in_place_of_a_term():
    found = {str(path): names_where(everyday_words, path) for path in own_modules(PACKAGE)}
    assert {path: names for path, names in found.items() if names} == {}


def test_no_class_of_the_package_shares_its_name_with_another_one():
    assert shared(classes()) == {}


def test_no_module_of_the_package_shares_its_name_with_another_one():
    assert shared(module_names(PACKAGE)) == {}


def test_no_test_module_shares_its_name_with_another_one():
    assert shared(module_names(TESTS)) == {}


def test_a_replacement_is_not_gone_itself():
    words = set(re.findall(r'\w+', ' '.join(GONE)))
    assert words & names_gone() == set()
