# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The analyses of the experiments ``corner_*``, which compare the motion with its pieces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.robot.check.corner_experiment import distances_from_corner, PIECES
from ur_cartesian_driver.robot.check.finding import Finding, note, ok
from ur_cartesian_driver.robot.check.motion_samples import MotionSamples

#: Largest accepted distance of the target joints from their path, without and with a pause [rad].
#: The simulated controller keeps within 0.01 mrad, or 0.1 mrad if calls come a step late.
FOLLOWED, FOLLOWED_IN_PAUSE = 1e-4, 1.4e-3
_NOT_FOLLOWED = 'The program followed no pieces: its log tells why.'


def followed(check: str, slider: float) -> Callable[[MotionSamples], Finding]:
    """
    Return the analysis of how closely the joints follow the pieces of the corner.

    :param slider: fraction of the speed slider; the lag of the arm is judged only at 1.
    """

    def analyse(samples: MotionSamples) -> Finding:
        own = _following(samples)
        if not own.any():
            return note(check, _NOT_FOLLOWED)
        beside = float(distances_from_corner(_since_start(samples, own)).max())
        lag = _lag(samples, own) if slider == 1.0 else 0.0
        cycle = float(np.median(np.diff(samples.time)))
        text = f'At {slider:.0%} of the speed the joints keep within {1e3 * beside:.3f} mrad of '
        text += f'their path (bound {1e3 * FOLLOWED:g})'
        if slider == 1.0:
            text += f', and the arm follows after {1e3 * lag:.1f} ms (bound {1e3 * cycle:.0f})'
        holds = beside <= FOLLOWED and lag <= cycle
        law = 'speedj is followed within a step'
        return (ok if holds else note)(
            check, f'{text}: {law}: {_verdict(holds)}.', beside=beside, lag=lag, confirmed=holds
        )

    return analyse


def steps(check: str) -> Callable[[MotionSamples], Finding]:
    """Return the analysis that counts the cycles in which the program did not advance."""

    def analyse(samples: MotionSamples) -> Finding:
        # The first piece is left out, because in it the program finds the fraction of the slider
        # (below 100 % its calls take more than a cycle by design); the last one, because it only
        # brakes.
        own = _following(samples)
        own[own] = (samples.pieces_begun[own] > 1) & (samples.pieces_begun[own] < PIECES)
        progress = np.diff(samples.spline_time[own])
        passed = np.diff(samples.time[own])
        follows = passed < 1.5 * np.median(passed) if len(passed) else passed > 0.0
        missed, cycles = int((follows & (progress == 0.0)).sum()), int(follows.sum())
        if not cycles:
            return note(check, _NOT_FOLLOWED)
        holds = missed == 0
        return (ok if holds else note)(
            check,
            f'{missed} of {cycles} cycles passed without a step of the program (bound 0): its '
            f'step ends within its cycle: {_verdict(holds)}.',
            missed=missed,
            cycles=cycles,
            confirmed=holds,
        )

    return analyse


def corner_pause(samples: MotionSamples) -> Finding:
    """Check that after a pause the program began all pieces, and the joints kept to their path."""
    own = _following(samples)
    paused = float(np.sum(np.diff(samples.time)[samples.runtime_state[1:] == RuntimeState.PAUSED]))
    if not own.any() or not paused:
        return note('corner_pause', 'The program was not paused in the corner.')
    begun = int(np.nanmax(samples.pieces_begun))
    beside = float(distances_from_corner(_since_start(samples, own)).max())
    holds = begun == PIECES and beside <= FOLLOWED_IN_PAUSE
    return (ok if holds else note)(
        'corner_pause',
        f'After a pause of {paused:.1f} s the program began {begun} of {PIECES} pieces (bound '
        f'{PIECES}) and kept within {1e3 * beside:.3f} mrad of the path (bound '
        f'{1e3 * FOLLOWED_IN_PAUSE:g}): a socket goes on after a pause: {_verdict(holds)}.',
        pause=paused,
        pieces=begun,
        beside=beside,
        confirmed=holds,
    )


def _verdict(holds: bool) -> str:
    return 'confirmed' if holds else 'not confirmed'


def _following(samples: MotionSamples) -> Flags:
    """Return a mask (n,) of the rows in which the program follows the pieces."""
    found = np.zeros(len(samples.time), dtype=np.bool_)
    changes = np.flatnonzero(np.abs(np.diff(samples.spline_time)) > 0.0)
    if len(changes):
        found[changes[0] + 1 : changes[-1] + 2] = True
    return found


def _since_start(samples: MotionSamples, own: Flags) -> Floats:
    """Return the target joints (m, 6): the first sample, at rest, then the rows of ``own``."""
    return np.vstack([samples.target_q[:1], samples.target_q[own]])


def _lag(samples: MotionSamples, own: Flags) -> float:
    """Return the time [s] by which the measured joints follow the target, by least squares."""
    speed = np.gradient(samples.target_q, samples.time, axis=0)[own]
    behind = (samples.target_q - samples.actual_q)[own]
    return float((behind * speed).sum() / max((speed * speed).sum(), 1e-12))
