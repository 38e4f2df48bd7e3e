# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Random input of an RTDE connection: packages of any kind, and garbage."""

from hypothesis import strategies as st

from ur_cartesian_driver.protocol.rtde.rtde_packages import PackageType


def framed(kind, payload):
    return (len(payload) + 3).to_bytes(2, 'big') + bytes([kind]) + payload


RANDOM_FRAMES = st.lists(
    st.binary(max_size=40)
    | st.builds(framed, st.sampled_from(PackageType), st.binary(max_size=40)),
    max_size=20,
)
